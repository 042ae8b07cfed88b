#include "serve/net/request_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>
#include <iterator>

namespace traceflow::serve {
namespace {

using Values = std::vector<std::string>;

const std::string token = "0123456789abcdef0123456789abcdef";

RequestGuard guard() { return {token, 8080, {"127.0.0.1:8080", "localhost:8080", "gpu.lab:80", "gpu.lab"}}; }

// What one part of a request may be, and whether that is right. Every value is of one kind of field.
struct Choice {
  Values values;
  bool right;
};

const std::vector<Choice> hosts = {
    {{"127.0.0.1:8080"}, true},
    {{"LOCALHOST:8080"}, true},
    {{"gpu.lab"}, true},
    {{}, false},
    {{""}, false},
    {{"127.0.0.1"}, false},
    {{"127.0.0.1:80800"}, false},
    {{"127.0.0.1:8080.evil.example"}, false},
    {{"evil.example"}, false},
    {{"user@127.0.0.1:8080"}, false},
    {{"127.0.0.1:8080, evil.example"}, false},
    {{"127.0.0.1:8080", "127.0.0.1:8080"}, false},
};
const std::vector<Choice> origins = {
    {{"http://127.0.0.1:8080"}, true},
    {{"http://localhost:8080"}, true},
    {{"https://127.0.0.1:8080"}, false},
    {{"http://127.0.0.1:8080/"}, false},
    {{"http://127.0.0.1:9"}, false},
    {{"http://evil.example"}, false},
    {{"null"}, false},
    {{""}, false},
    {{"http://127.0.0.1:8080", "http://127.0.0.1:8080"}, false},
};
const std::vector<Choice> sites = {
    {{}, true},
    {{"same-origin"}, true},
    {{"none"}, true},
    {{"same-site"}, false},
    {{"cross-site"}, false},
    {{"nonsense"}, false},
    {{"same-origin", "cross-site"}, false},
};
const std::vector<Choice> cookies = {
    {{"traceflow_8080=" + token}, true},
    {{"a=b; traceflow_8080=" + token + " ; c"}, true},
    {{"traceflow_8080=set by another server; traceflow_8080=" + token}, true},
    {{"a=b", "traceflow_8080=" + token}, true},
    {{}, false},
    {{""}, false},
    {{";;=;"}, false},
    {{"traceflow_8080"}, false},
    {{"traceflow_8080="}, false},
    {{"traceflow_8081=" + token}, false},
    {{"xtraceflow_8080=" + token}, false},
    {{"Traceflow_8080=" + token}, false},
    {{"traceflow_8080=" + token + "0"}, false},
    {{"traceflow_8080=" + token.substr(1)}, false},
    {{"a=traceflow_8080=" + token}, false},
};
const std::vector<Choice> bodies = {
    {{}, true}, {{"0"}, true}, {{"1"}, false}, {{""}, false}, {{"0", "5"}, false},
};

// A request that owns what it says.
class Asking {
 public:
  Asking& with(std::string_view name, const Values& values) {
    for (const std::string& value : values) request.fields.push_back({name, texts_.emplace_back(value)});
    return *this;
  }
  Asking& to(const std::string& target) {
    request.target = texts_.emplace_back(target);
    return *this;
  }
  Request request{"GET", "/viewer.js", {}, false, true};

 private:
  std::deque<std::string> texts_;
};

// Mostly right, so that the whole often is.
Choice pick(const std::vector<Choice>& choices) {
  std::vector<Choice> right;
  std::copy_if(choices.begin(), choices.end(), std::back_inserter(right),
               [](const Choice& c) { return c.right; });
  return *rc::gen::weightedOneOf<Choice>({{6, rc::gen::elementOf(right)}, {1, rc::gen::elementOf(choices)}});
}

int status(const Request& request) {
  const auto refusal = guard().refusal(request);
  return refusal ? refusal->status : 200;
}

RC_GTEST_PROP(RequestGuard, LetsARequestPassWhenEveryPartIsRight, ()) {
  const Choice host = pick(hosts);
  const Choice origin = pick(origins);
  const Choice site = pick(sites);
  const Choice cookie = pick(cookies);
  const Choice body = pick(bodies);
  const bool says_origin = *rc::gen::arbitrary<bool>();
  Asking asking;
  asking.request.upgrade = *rc::gen::arbitrary<bool>();
  asking.request.method =
      *rc::gen::element<std::string_view>("GET", "GET", "GET", "HEAD", "HEAD", "POST", "get");
  asking.with("host", host.values).with("Sec-Fetch-Site", site.values).with("COOKIE", cookie.values);
  asking.with("Content-Length", body.values);
  if (says_origin) asking.with("Origin", origin.values);
  // The order of fields is of no account.
  const size_t turn = *rc::gen::inRange<size_t>(0, asking.request.fields.size() + 1);
  std::reverse(asking.request.fields.begin(), asking.request.fields.begin() + static_cast<ptrdiff_t>(turn));
  const bool origin_right = says_origin ? origin.right : !asking.request.upgrade;
  const bool method_right = asking.request.method == "GET" || asking.request.method == "HEAD";
  const bool right = host.right && origin_right && site.right && cookie.right && body.right && method_right;
  RC_ASSERT((status(asking.request) == 200) == right);
}

RC_GTEST_PROP(RequestGuard, NoGuessPasses, ()) {
  const auto guess = *rc::gen::oneOf(rc::gen::arbitrary<std::string>(),
                                     rc::gen::container<std::string>(32, rc::gen::elementOf(token)));
  RC_PRE(guess != token);
  Asking asking;
  asking.with("Host", {"localhost:8080"}).with("Cookie", {"traceflow_8080=" + guess});
  asking.to("/?token=" + guess);
  RC_ASSERT(status(asking.request) == 403);
}

TEST(RequestGuard, TheTokenOpensThePageAlone) {
  Asking asking;
  asking.with("Host", {"localhost:8080"});
  const auto status_of = [&](const std::string& target) { return status(asking.to(target).request); };
  EXPECT_EQ(status_of("/?token=" + token), 200);
  EXPECT_EQ(status_of("/?a=b&token=" + token + "&c"), 200);
  EXPECT_EQ(status_of("/?token=1&token=" + token), 403);
  EXPECT_EQ(status_of("/?Token=" + token), 403);
  EXPECT_EQ(status_of("/?&&=&token"), 403);
  EXPECT_EQ(status_of("/token=" + token), 403);
  EXPECT_EQ(status_of("/#?token=" + token), 403);
  EXPECT_EQ(status_of("/viewer.js?token=" + token), 403);
  EXPECT_EQ(status_of("/index.html?token=" + token), 403);
  asking.request.upgrade = true;
  asking.with("Origin", {"http://localhost:8080"});
  EXPECT_EQ(status_of("/ws?token=" + token), 403);
  EXPECT_EQ(status_of("/?token=" + token), 403);
}

TEST(RequestGuard, AnotherSiteMayLeadAVisitorToThePageAndNoFurther) {
  const auto status_of = [](const std::string& mode, const std::string& destination,
                            const std::string& target) {
    Asking asking;
    asking.with("Host", {"localhost:8080"}).with("Sec-Fetch-Site", {"cross-site"});
    asking.with("Sec-Fetch-Mode", {mode}).with("Sec-Fetch-Dest", {destination});
    return status(asking.to(target).request);
  };
  EXPECT_EQ(status_of("navigate", "document", "/?token=" + token), 200);
  EXPECT_EQ(status_of("navigate", "iframe", "/?token=" + token), 403);
  EXPECT_EQ(status_of("no-cors", "image", "/?token=" + token), 403);
  EXPECT_EQ(status_of("cors", "empty", "/?token=" + token), 403);
}

TEST(RequestGuard, ACookieDoesNotLetAnotherSiteNavigateToFiles) {
  Asking asking;
  asking.with("Host", {"localhost:8080"}).with("Cookie", {"traceflow_8080=" + token});
  asking.with("Sec-Fetch-Site", {"cross-site"})
      .with("Sec-Fetch-Mode", {"navigate"})
      .with("Sec-Fetch-Dest", {"document"});
  EXPECT_EQ(status(asking.request), 403);
}

TEST(RequestGuard, DoesNotTellAStrangerWhetherAHostsTokenWasRight) {
  Asking asking;
  asking.with("Host", {"evil.example"}).with("Cookie", {"traceflow_8080=" + token});
  EXPECT_EQ(status(asking.request), 421);
  EXPECT_EQ(guard().refusal(asking.request)->words.find("evil"), std::string::npos);
}

}  // namespace
}  // namespace traceflow::serve

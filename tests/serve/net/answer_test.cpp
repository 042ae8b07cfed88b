#include "serve/net/answer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace traceflow::serve {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

constexpr unsigned char bytes[] = {'a', '\0', 0xFF};
constexpr EmbeddedFile page[] = {{"index.html", bytes},
                                 {"viewer.js", bytes},
                                 {"viewer.css", bytes},
                                 {"icon.svg", bytes},
                                 {"other", bytes}};

Answer answer_to(std::string_view target, bool upgrade = false) {
  const RequestGuard guard("secret", 80, {"here"});
  return answer(guard, page,
                {"GET",
                 target,
                 {{"Host", "here"}, {"Origin", "http://here"}, {"Cookie", "traceflow_80=secret"}},
                 upgrade});
}

TEST(Answer, FindsThePagesFilesByName) {
  EXPECT_EQ(answer_to("/").body, std::string("a\0\xFF", 3));
  EXPECT_EQ(answer_to("/").type, "text/html; charset=utf-8");
  EXPECT_EQ(answer_to("/index.html").status, 200);
  EXPECT_EQ(answer_to("/viewer.js?v=2").type, "text/javascript; charset=utf-8");
  EXPECT_EQ(answer_to("/viewer.css").type, "text/css; charset=utf-8");
  EXPECT_EQ(answer_to("/icon.svg").type, "image/svg+xml");
  EXPECT_EQ(answer_to("/other").type, "application/octet-stream");
  EXPECT_EQ(answer_to("/nothing").status, 404);
}

TEST(Answer, BecomesASocketAtOnePlace) {
  EXPECT_EQ(answer_to("/ws", true).status, 101);
  EXPECT_EQ(answer_to("/ws").status, 426);
  EXPECT_EQ(answer_to("/", true).status, 404);
  EXPECT_EQ(answer_to("/ws/", true).status, 404);
}

TEST(Answer, GivesTheCookieToWhoBringsTheTokenAlone) {
  EXPECT_TRUE(answer_to("/").fields.empty());
  const auto fields = answer_to("/?token=secret").fields;
  ASSERT_EQ(fields.size(), 1U);
  EXPECT_EQ(fields[0].first, "Set-Cookie");
}

TEST(Answer, IsWrittenAsHttp) {
  const std::string text = wire_text(plain_answer(405, "No."), {true, false});
  EXPECT_THAT(text, StartsWith("HTTP/1.1 405 Method Not Allowed\r\n"));
  EXPECT_THAT(text, HasSubstr("\r\nAllow: GET, HEAD\r\n"));
  EXPECT_THAT(text, HasSubstr("\r\nContent-Length: 4\r\n"));
  EXPECT_THAT(text, HasSubstr("\r\nConnection: close\r\n"));
  EXPECT_THAT(text, EndsWith("\r\n\r\nNo.\n"));
  EXPECT_THAT(wire_text(answer_to("/"), {false, true}),
              EndsWith("\r\nContent-Length: 3\r\nConnection: keep-alive\r\n\r\n"));
}

TEST(Answer, AlwaysHasTheSafetyFields) {
  for (const int status : {200, 400, 403, 404, 405, 413, 421, 426, 431, 503}) {
    const std::string text = wire_text(plain_answer(status, "words"), {});
    EXPECT_THAT(
        text,
        HasSubstr("\r\nContent-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; "
                  "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
                  "frame-ancestors 'none'\r\n"));
    EXPECT_THAT(text, HasSubstr("\r\nX-Content-Type-Options: nosniff\r\n"));
    EXPECT_THAT(text, HasSubstr("\r\nReferrer-Policy: no-referrer\r\n"));
    EXPECT_THAT(text, HasSubstr("\r\nCross-Origin-Resource-Policy: same-origin\r\n"));
    EXPECT_THAT(text, HasSubstr("\r\nCross-Origin-Opener-Policy: same-origin\r\n"));
    EXPECT_THAT(text, HasSubstr("\r\nCache-Control: no-store\r\n"));
    EXPECT_EQ(text.find("HTTP/1.1 " + std::to_string(status) + " Error"), std::string::npos);
  }
}

}  // namespace
}  // namespace traceflow::serve

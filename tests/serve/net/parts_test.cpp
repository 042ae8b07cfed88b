// The small parts: token, mailbox, options, the page in the program.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

#include "serve/net/mailbox.h"
#include "serve/net/server.h"
#include "serve/net/token.h"

namespace traceflow::serve {
namespace {

Outgoing outgoing(size_t bytes) { return {std::make_shared<const std::string>(bytes, 'x'), false}; }

TEST(Token, Is128BitsInHexAndNeverTheSame) {
  std::set<std::string> tokens;
  for (int i = 0; i < 100; ++i) tokens.insert(random_token());
  EXPECT_EQ(tokens.size(), 100U);
  std::set<char> digits;
  for (const std::string& token : tokens) {
    EXPECT_EQ(token.size(), 32U);
    digits.insert(token.begin(), token.end());
  }
  EXPECT_EQ(std::string(digits.begin(), digits.end()), "0123456789abcdef");
}

RC_GTEST_PROP(Token, SecretsAreTheSameWhenTheirBytesAre, (const std::string& a, const std::string& b)) {
  RC_ASSERT(same_secret(a, a));
  RC_ASSERT(same_secret(a, b) == (a == b));
}

TEST(Token, ASecretsBeginningIsNotTheSecret) {
  const std::string secret("abc\0", 4);
  EXPECT_TRUE(same_secret(secret, secret));
  EXPECT_FALSE(same_secret(secret, secret.substr(0, 3)));
  EXPECT_FALSE(same_secret(secret.substr(0, 3), secret));
  EXPECT_FALSE(same_secret("", secret));
}

TEST(Mailbox, WakesOnceForWhatWaits) {
  int wakes = 0;
  Mailbox mailbox(10, 100, [&] { ++wakes; });
  mailbox.put(outgoing(1));
  mailbox.put(outgoing(2));
  EXPECT_EQ(wakes, 1);
  EXPECT_EQ(mailbox.take()->bytes->size(), 1U);
  EXPECT_EQ(mailbox.take()->bytes->size(), 2U);
  EXPECT_FALSE(mailbox.take());
  mailbox.put(outgoing(3));
  EXPECT_EQ(wakes, 2);
}

TEST(Mailbox, OverflowsBeyondItsMessages) {
  int wakes = 0;
  Mailbox mailbox(2, 100, [&] { ++wakes; });
  mailbox.put(outgoing(0));
  mailbox.put(outgoing(0));
  EXPECT_FALSE(mailbox.overflowed());
  mailbox.put(outgoing(0));
  EXPECT_TRUE(mailbox.overflowed());
  EXPECT_EQ(wakes, 2);
  mailbox.put(outgoing(0));
  EXPECT_EQ(wakes, 2);
}

TEST(Mailbox, OverflowsBeyondItsBytesButTakesOneMessageOfAnySize) {
  Mailbox mailbox(10, 100, [] {});
  mailbox.put(outgoing(1000));
  EXPECT_FALSE(mailbox.overflowed());
  EXPECT_EQ(mailbox.take()->bytes->size(), 1000U);
  mailbox.put(outgoing(99));
  mailbox.put(outgoing(1));
  EXPECT_FALSE(mailbox.overflowed());
  mailbox.put(outgoing(0));
  EXPECT_TRUE(mailbox.overflowed());
}

TEST(Mailbox, IsDeafWhenClosed) {
  int wakes = 0;
  Mailbox mailbox(1, 1, [&] { ++wakes; });
  mailbox.put(outgoing(1));
  mailbox.close();
  mailbox.put(outgoing(1));
  EXPECT_FALSE(mailbox.take());
  EXPECT_FALSE(mailbox.overflowed());
  EXPECT_EQ(wakes, 1);
}

TEST(Mailbox, IgnoresWhatHasNoBytes) {
  Mailbox mailbox(1, 1, [] { FAIL(); });
  mailbox.put({});
  EXPECT_FALSE(mailbox.take());
}

TEST(ServerOptions, RefuseWhatCannotBe) {
  const auto good = [](auto change) {
    ServerOptions options;
    change(options);
    try {
      options.validate();
      return true;
    } catch (const InputError&) {
      return false;
    }
  };
  EXPECT_TRUE(good([](auto&) {}));
  EXPECT_TRUE(good([](auto& o) { o.bind = "0.0.0.0"; }));
  EXPECT_TRUE(good([](auto& o) { o.bind = "::1"; }));
  EXPECT_FALSE(good([](auto& o) { o.bind = "localhost"; }));
  EXPECT_FALSE(good([](auto& o) { o.bind = ""; }));
  EXPECT_FALSE(good([](auto& o) { o.port = -1; }));
  EXPECT_FALSE(good([](auto& o) { o.port = 65536; }));
  EXPECT_FALSE(good([](auto& o) { o.connections = 0; }));
  for (const std::string host : {"a:1", "gpu.lab:8080", "192.0.2.1:65535", "[::1]:80", "a-b_c.example:9"}) {
    EXPECT_TRUE(good([&](auto& o) { o.allowed_hosts = {"a:1", host}; })) << host;
  }
  for (const std::string host :
       {"", ":", "a", "a:", ":1", "a:0", "a:01", "a:65536", "a:123456", "a:x", "a b:1", "a/b:1", "*:1",
        "a@b:1", "::1:80", "[::1:80", "[x]:80", "http://a:1"}) {
    EXPECT_FALSE(good([&](auto& o) { o.allowed_hosts = {"a:1", host}; })) << host;
  }
}

TEST(Page, IsInTheProgram) {
  std::set<std::string_view> names;
  for (const EmbeddedFile& file : embedded_files()) {
    names.insert(file.name);
    EXPECT_FALSE(file.bytes.empty()) << file.name;
  }
  EXPECT_TRUE(names.contains("index.html"));
  EXPECT_TRUE(names.contains("viewer.js"));
}

}  // namespace
}  // namespace traceflow::serve

#include "serve/net/server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "serve/net/test_server.h"

namespace traceflow::serve {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

TEST(Server, GivesThePageAndTheCookieToWhoBringsTheToken) {
  const TestServer test_server;
  EXPECT_EQ(test_server.server.address(),
            "http://127.0.0.1:" + std::to_string(test_server.server.port()) + "/?token=" + test_server.token);
  const auto reply = test_server.ask("GET /?token=" + test_server.token, test_server.host_line());
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
  EXPECT_EQ(reply->body, "<p>hi");
  EXPECT_EQ(reply->fields.at("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(reply->fields.at("set-cookie"), "traceflow_" + std::to_string(test_server.server.port()) + "=" +
                                                test_server.token + "; HttpOnly; SameSite=Strict; Path=/");
  EXPECT_EQ(reply->fields.at("x-content-type-options"), "nosniff");
  EXPECT_THAT(reply->fields.at("content-security-policy"), HasSubstr("default-src 'none'"));
  EXPECT_FALSE(reply->fields.contains("access-control-allow-origin"));
}

TEST(Server, GivesNothingWithoutTokenOrCookie) {
  const TestServer test_server;
  const std::string host = test_server.host_line();
  EXPECT_EQ(test_server.status("GET /", host), 403);
  EXPECT_EQ(test_server.status("GET /?token=", host), 403);
  EXPECT_EQ(test_server.status("GET /?token=0123456789abcdef0123456789abcdef", host), 403);
  EXPECT_EQ(test_server.status("GET /viewer.js?token=" + test_server.token, host), 403);
  EXPECT_EQ(test_server.status("GET /viewer.js", host), 403);
  EXPECT_EQ(test_server.status("GET /viewer.js", host + "Cookie: traceflow=1\r\n"), 403);
  EXPECT_EQ(test_server.status("GET /nothing", host), 403);
  EXPECT_EQ(test_server.status("GET /viewer.js", host + test_server.cookie_line()), 200);
  EXPECT_EQ(test_server.status("GET /", host + test_server.cookie_line()), 200);
}

TEST(Server, AnswersUnderItsOwnNamesAlone) {
  const TestServer test_server;
  const std::string port = std::to_string(test_server.server.port());
  const auto status = [&](const std::string& lines) {
    return test_server.status("GET /", lines + test_server.cookie_line());
  };
  EXPECT_EQ(status("Host: localhost:" + port + "\r\n"), 200);
  EXPECT_EQ(status(""), 400);
  EXPECT_EQ(status(test_server.host_line() + test_server.host_line()), 400);
  EXPECT_EQ(status("Host: evil.example:" + port + "\r\n"), 421);
  EXPECT_EQ(status("Host: 127.0.0.1\r\n"), 421);
  EXPECT_EQ(status("Host: 127.0.0.1:1\r\n"), 421);
  const auto reply = test_server.ask("GET /", "Host: localhost:1\r\n");
  ASSERT_TRUE(reply);
  EXPECT_THAT(reply->body, HasSubstr("ssh -L " + port + ":127.0.0.1:" + port));
  EXPECT_THAT(reply->body, HasSubstr("--allow-host"));
}

TEST(Server, AnswersUnderTheNamesItIsAllowed) {
  ServerOptions options;
  options.allowed_hosts = {"Gpu.Lab:9000", "[::1]:9000"};
  const TestServer test_server({}, options);
  EXPECT_EQ(test_server.status("GET /", "Host: gpu.lab:9000\r\n" + test_server.cookie_line()), 200);
  EXPECT_EQ(test_server.status("GET /", "Host: [::1]:9000\r\n" + test_server.cookie_line()), 200);
  EXPECT_EQ(test_server.status("GET /", "Host: gpu.lab:9001\r\n" + test_server.cookie_line()), 421);
}

TEST(Server, NoPathLeadsOutOfThePage) {
  const TestServer test_server;
  const std::string lines = test_server.host_line() + test_server.cookie_line();
  for (const std::string path :
       {"/../viewer.js", "/./viewer.js", "//viewer.js", "/viewer.js/", "/%76iewer.js", "/VIEWER.JS",
        "/../../../../etc/passwd", "/%2e%2e/etc/passwd", "/etc/passwd", "/viewer.js%00"}) {
    EXPECT_EQ(test_server.status("GET " + path, lines), 404) << path;
  }
  EXPECT_EQ(test_server.status("GET viewer.js", lines), 400);
  EXPECT_EQ(test_server.status("GET http://127.0.0.1/", lines), 400);
}

TEST(Server, TakesGetAndHeadWithoutABody) {
  const TestServer test_server;
  const std::string lines = test_server.host_line() + test_server.cookie_line();
  for (const std::string method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "NONSENSE"}) {
    EXPECT_EQ(test_server.status(method + " /", lines), 405) << method;
  }
  const auto head = test_server.ask("HEAD /", lines);
  ASSERT_TRUE(head);
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->fields.at("content-length"), "5");
  EXPECT_EQ(test_server.status("GET /", lines + "Content-Length: 0\r\n"), 200);
  EXPECT_EQ(test_server.status("GET /", lines + "Content-Length: 5\r\n"), 413);
  EXPECT_EQ(test_server.status("GET /", lines + "Content-Length: 99999999999\r\n"), 413);
  EXPECT_EQ(test_server.status("GET /", lines + "Transfer-Encoding: chunked\r\n"), 413);
}

TEST(Server, SaysWhyToAClientThatGoesOnSending) {
  Limits limits;
  limits.linger = std::chrono::hours(1);
  const TestServer test_server(limits);
  HttpClient client(test_server.server.port());
  ASSERT_TRUE(
      client.send("GET / HTTP/1.1\r\n" + test_server.host_line() + "Content-Length: 9000000\r\n\r\n"));
  const auto reply = client.reply();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 413);
  // A connection that is closed at once breaks here, and would take the answer from who reads it later.
  for (int i = 0; i < 90; ++i) EXPECT_TRUE(client.send(std::string(100'000, 'x')));
}

TEST(Server, EndsAConnectionThatIsNotToStay) {
  Limits limits;
  limits.request = std::chrono::hours(1);
  const TestServer test_server(limits);
  for (const std::string first : {"GET / HTTP/1.1\r\nConnection: close\r\n", "GET / HTTP/1.0\r\n"}) {
    HttpClient client(test_server.server.port());
    client.send(first + test_server.host_line() + test_server.cookie_line() + "\r\n");
    const auto reply = client.reply();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
    EXPECT_EQ(reply->fields.at("connection"), "close");
    EXPECT_TRUE(client.ends());
  }
}

TEST(Server, RefusesWhatIsTooLongOrNotHttp) {
  const TestServer test_server;
  const std::string lines = test_server.host_line() + test_server.cookie_line();
  EXPECT_EQ(test_server.status("GET /", lines + "X: " + std::string(7000, 'x') + "\r\n"), 200);
  EXPECT_EQ(test_server.status("GET /", lines + "X: " + std::string(9000, 'x') + "\r\n"), 431);
  const std::string half(5000, 'x');
  EXPECT_EQ(test_server.status("GET /" + half, lines), 404);
  EXPECT_EQ(test_server.status("GET /" + half, lines + "X: " + half + "\r\n"), 431);
  EXPECT_EQ(test_server.status("GET /" + std::string(100'000, 'x'), lines), 431);
  EXPECT_EQ(test_server.status("no such thing", lines), 400);
  EXPECT_EQ(test_server.status("GET /", "Host : a b\r\n"), 400);
}

TEST(Server, AnswersOneRequestAfterAnother) {
  const TestServer test_server;
  HttpClient client(test_server.server.port());
  const std::string lines = " HTTP/1.1\r\n" + test_server.host_line() + test_server.cookie_line() + "\r\n";
  // All at once, as a client may.
  client.send("GET /" + lines + "GET /nothing" + lines + "GET /viewer.js" + lines + "POST /" + lines);
  for (const int expected : {200, 404, 200, 405}) {
    const auto reply = client.reply();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, expected);
  }
  EXPECT_TRUE(client.ends());
}

TEST(Server, DropsARequestThatTricklesIn) {
  Limits limits;
  limits.request = milliseconds(200);
  const TestServer test_server(limits);
  HttpClient silent(test_server.server.port());
  HttpClient slow(test_server.server.port());
  slow.send("GET / HTTP/1.1\r\nX: ");
  int bytes = 0;
  while (bytes < 2000 && slow.send("x")) {
    std::this_thread::sleep_for(milliseconds(5));
    ++bytes;
  }
  EXPECT_LT(bytes, 2000);
  EXPECT_TRUE(silent.ends());
}

TEST(Server, DropsAConnectionThatIsNotUsedAgain) {
  Limits limits;
  limits.request = milliseconds(100);
  const TestServer test_server(limits);
  HttpClient client(test_server.server.port());
  client.send("GET / HTTP/1.1\r\n" + test_server.host_line() + test_server.cookie_line() + "\r\n");
  ASSERT_TRUE(client.reply());
  EXPECT_TRUE(client.ends());
}

TEST(Server, TurnsAwayMoreThanItsConnections) {
  ServerOptions options;
  options.connections = 2;
  const TestServer test_server({}, options);
  const std::string request =
      "GET / HTTP/1.1\r\n" + test_server.host_line() + test_server.cookie_line() + "\r\n";
  std::optional<HttpClient> first(test_server.server.port());
  HttpClient second(test_server.server.port());
  ASSERT_TRUE(first->send(request));
  ASSERT_TRUE(first->reply());
  ASSERT_TRUE(second.send(request));
  ASSERT_TRUE(second.reply());
  const auto third = test_server.ask("GET /", test_server.host_line() + test_server.cookie_line());
  ASSERT_TRUE(third);
  EXPECT_EQ(third->status, 503);
  first.reset();
  // When the server notices is its own affair.
  while (test_server.status("GET /", test_server.host_line() + test_server.cookie_line()) != 200)
    std::this_thread::yield();
}

TEST(Server, StrangersDoNotKeepOutWhoHasTheToken) {
  ServerOptions options;
  options.connections = 4;
  TestServer test_server({}, options);
  WebSocketClient client = test_server.client();
  test_server.handler.wait_entered(1);
  std::vector<HttpClient> strangers;
  strangers.reserve(20);
  for (int i = 0; i < 20; ++i) strangers.emplace_back(test_server.server.port());
  EXPECT_EQ(test_server.status("GET /", test_server.host_line() + test_server.cookie_line()), 200);
  EXPECT_TRUE(strangers.front().ends());
  // Who is known is not sent away for them.
  ASSERT_TRUE(client.send_text("hello"));
  EXPECT_TRUE(client.message());
}

TEST(Server, ManyConnectionsAtOnceEndNothing) {
  Limits limits;
  limits.linger = milliseconds(100);
  const TestServer test_server(limits);
  std::vector<HttpClient> crowd;
  crowd.reserve(100);
  for (int i = 0; i < 100; ++i) crowd.emplace_back(test_server.server.port());
  int ended = 0;
  for (HttpClient& client : crowd) {
    client.send("GET / HTTP/1.1\r\n\r\n");
    const auto reply = client.reply();
    ended += reply ? 0 : 1;
    EXPECT_TRUE(client.ends());
  }
  EXPECT_GT(ended, 0);
  while (test_server.status("GET /", test_server.host_line() + test_server.cookie_line()) != 200)
    std::this_thread::yield();
}

TEST(Server, EndsAtOnceWithOpenConnections) {
  std::optional<TestServer> test_server(std::in_place);
  HttpClient silent(test_server->server.port());
  HttpClient halfway(test_server->server.port());
  halfway.send("GET /");
  WebSocketClient client = test_server->client();
  test_server->handler.wait_entered(1);
  test_server.reset();
  EXPECT_TRUE(silent.ends());
  EXPECT_TRUE(halfway.ends());
  EXPECT_TRUE(client.client().ends());
}

TEST(Server, EveryGuestHasLeftWhenItHasEnded) {
  EchoHandler handler;
  std::optional<TestServer> test_server(std::in_place, Limits{}, ServerOptions{}, &handler);
  const WebSocketClient first = test_server->client();
  const WebSocketClient second = test_server->client();
  handler.wait_entered(2);
  test_server.reset();
  EXPECT_EQ(handler.left().size(), 2U);
}

TEST(Server, APortThatIsTakenIsSaidInWords) {
  const TestServer test_server;
  ServerOptions options;
  options.port = test_server.server.port();
  EchoHandler handler;
  try {
    const Server second(options, TestServer::page, handler);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(std::to_string(options.port) + ", which another program has"));
  }
}

TEST(Server, AnAddressOfAnotherMachineIsSaidInWords) {
  ServerOptions options;
  options.bind = "192.0.2.1";
  EchoHandler handler;
  EXPECT_THROW(Server(options, TestServer::page, handler), InputError);
}

TEST(Server, WhereAnybodyMayAskTheTokenIsAskedForToo) {
  ServerOptions options;
  options.bind = "0.0.0.0";
  const TestServer test_server({}, options);
  EXPECT_EQ(test_server.server.address().find("http://127.0.0.1:"), 0U);
  EXPECT_EQ(test_server.status("GET /", test_server.host_line()), 403);
  EXPECT_EQ(
      test_server.status("GET /", "Host: 0.0.0.0:" + std::to_string(test_server.server.port()) + "\r\n"),
      421);
  EXPECT_EQ(test_server.status("GET /?token=" + test_server.token, test_server.host_line()), 200);
}

TEST(Server, TokensDiffer) { EXPECT_NE(TestServer().token, TestServer().token); }

}  // namespace
}  // namespace traceflow::serve

#include "serve/net/server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "serve/net/house.h"

namespace traceflow::serve {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

TEST(Server, GivesThePageAndTheCookieToWhoBringsTheToken) {
  const House house;
  EXPECT_EQ(house.server.address(),
            "http://127.0.0.1:" + std::to_string(house.server.port()) + "/?token=" + house.token);
  const auto reply = house.ask("GET /?token=" + house.token, house.host_line());
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
  EXPECT_EQ(reply->body, "<p>hi");
  EXPECT_EQ(reply->fields.at("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(reply->fields.at("set-cookie"), "traceflow_" + std::to_string(house.server.port()) + "=" +
                                                house.token + "; HttpOnly; SameSite=Strict; Path=/");
  EXPECT_EQ(reply->fields.at("x-content-type-options"), "nosniff");
  EXPECT_THAT(reply->fields.at("content-security-policy"), HasSubstr("default-src 'none'"));
  EXPECT_FALSE(reply->fields.contains("access-control-allow-origin"));
}

TEST(Server, GivesNothingWithoutTokenOrCookie) {
  const House house;
  const std::string host = house.host_line();
  EXPECT_EQ(house.status("GET /", host), 403);
  EXPECT_EQ(house.status("GET /?token=", host), 403);
  EXPECT_EQ(house.status("GET /?token=0123456789abcdef0123456789abcdef", host), 403);
  EXPECT_EQ(house.status("GET /viewer.js?token=" + house.token, host), 403);
  EXPECT_EQ(house.status("GET /viewer.js", host), 403);
  EXPECT_EQ(house.status("GET /viewer.js", host + "Cookie: traceflow=1\r\n"), 403);
  EXPECT_EQ(house.status("GET /nothing", host), 403);
  EXPECT_EQ(house.status("GET /viewer.js", host + house.cookie_line()), 200);
  EXPECT_EQ(house.status("GET /", host + house.cookie_line()), 200);
}

TEST(Server, AnswersUnderItsOwnNamesAlone) {
  const House house;
  const std::string port = std::to_string(house.server.port());
  const auto status = [&](const std::string& lines) {
    return house.status("GET /", lines + house.cookie_line());
  };
  EXPECT_EQ(status("Host: localhost:" + port + "\r\n"), 200);
  EXPECT_EQ(status(""), 400);
  EXPECT_EQ(status(house.host_line() + house.host_line()), 400);
  EXPECT_EQ(status("Host: evil.example:" + port + "\r\n"), 421);
  EXPECT_EQ(status("Host: 127.0.0.1\r\n"), 421);
  EXPECT_EQ(status("Host: 127.0.0.1:1\r\n"), 421);
  const auto reply = house.ask("GET /", "Host: localhost:1\r\n");
  ASSERT_TRUE(reply);
  EXPECT_THAT(reply->body, HasSubstr("ssh -L " + port + ":127.0.0.1:" + port));
  EXPECT_THAT(reply->body, HasSubstr("--allow-host"));
}

TEST(Server, AnswersUnderTheNamesItIsAllowed) {
  ServerOptions options;
  options.allowed_hosts = {"Gpu.Lab:9000", "[::1]:9000"};
  const House house({}, options);
  EXPECT_EQ(house.status("GET /", "Host: gpu.lab:9000\r\n" + house.cookie_line()), 200);
  EXPECT_EQ(house.status("GET /", "Host: [::1]:9000\r\n" + house.cookie_line()), 200);
  EXPECT_EQ(house.status("GET /", "Host: gpu.lab:9001\r\n" + house.cookie_line()), 421);
}

TEST(Server, NoPathLeadsOutOfThePage) {
  const House house;
  const std::string lines = house.host_line() + house.cookie_line();
  for (const std::string path :
       {"/../viewer.js", "/./viewer.js", "//viewer.js", "/viewer.js/", "/%76iewer.js", "/VIEWER.JS",
        "/../../../../etc/passwd", "/%2e%2e/etc/passwd", "/etc/passwd", "/viewer.js%00"}) {
    EXPECT_EQ(house.status("GET " + path, lines), 404) << path;
  }
  EXPECT_EQ(house.status("GET viewer.js", lines), 400);
  EXPECT_EQ(house.status("GET http://127.0.0.1/", lines), 400);
}

TEST(Server, TakesGetAndHeadWithoutABody) {
  const House house;
  const std::string lines = house.host_line() + house.cookie_line();
  for (const std::string method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "NONSENSE"}) {
    EXPECT_EQ(house.status(method + " /", lines), 405) << method;
  }
  const auto head = house.ask("HEAD /", lines);
  ASSERT_TRUE(head);
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->fields.at("content-length"), "5");
  EXPECT_EQ(house.status("GET /", lines + "Content-Length: 0\r\n"), 200);
  EXPECT_EQ(house.status("GET /", lines + "Content-Length: 5\r\n"), 413);
  EXPECT_EQ(house.status("GET /", lines + "Content-Length: 99999999999\r\n"), 413);
  EXPECT_EQ(house.status("GET /", lines + "Transfer-Encoding: chunked\r\n"), 413);
}

TEST(Server, SaysWhyToAClientThatGoesOnSending) {
  Limits limits;
  limits.linger = std::chrono::hours(1);
  const House house(limits);
  Client client(house.server.port());
  ASSERT_TRUE(client.send("GET / HTTP/1.1\r\n" + house.host_line() + "Content-Length: 9000000\r\n\r\n"));
  const auto reply = client.reply();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 413);
  // A connection that is closed at once breaks here, and would take the answer from who reads it later.
  for (int i = 0; i < 90; ++i) EXPECT_TRUE(client.send(std::string(100'000, 'x')));
}

TEST(Server, EndsAConnectionThatIsNotToStay) {
  Limits limits;
  limits.request = std::chrono::hours(1);
  const House house(limits);
  for (const std::string first : {"GET / HTTP/1.1\r\nConnection: close\r\n", "GET / HTTP/1.0\r\n"}) {
    Client client(house.server.port());
    client.send(first + house.host_line() + house.cookie_line() + "\r\n");
    const auto reply = client.reply();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
    EXPECT_EQ(reply->fields.at("connection"), "close");
    EXPECT_TRUE(client.ends());
  }
}

TEST(Server, RefusesWhatIsTooLongOrNotHttp) {
  const House house;
  const std::string lines = house.host_line() + house.cookie_line();
  EXPECT_EQ(house.status("GET /", lines + "X: " + std::string(7000, 'x') + "\r\n"), 200);
  EXPECT_EQ(house.status("GET /", lines + "X: " + std::string(9000, 'x') + "\r\n"), 431);
  const std::string half(5000, 'x');
  EXPECT_EQ(house.status("GET /" + half, lines), 404);
  EXPECT_EQ(house.status("GET /" + half, lines + "X: " + half + "\r\n"), 431);
  EXPECT_EQ(house.status("GET /" + std::string(100'000, 'x'), lines), 431);
  EXPECT_EQ(house.status("no such thing", lines), 400);
  EXPECT_EQ(house.status("GET /", "Host : a b\r\n"), 400);
}

TEST(Server, AnswersOneRequestAfterAnother) {
  const House house;
  Client client(house.server.port());
  const std::string lines = " HTTP/1.1\r\n" + house.host_line() + house.cookie_line() + "\r\n";
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
  const House house(limits);
  Client silent(house.server.port());
  Client slow(house.server.port());
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
  const House house(limits);
  Client client(house.server.port());
  client.send("GET / HTTP/1.1\r\n" + house.host_line() + house.cookie_line() + "\r\n");
  ASSERT_TRUE(client.reply());
  EXPECT_TRUE(client.ends());
}

TEST(Server, TurnsAwayMoreThanItsConnections) {
  ServerOptions options;
  options.connections = 2;
  const House house({}, options);
  const std::string request = "GET / HTTP/1.1\r\n" + house.host_line() + house.cookie_line() + "\r\n";
  std::optional<Client> first(house.server.port());
  Client second(house.server.port());
  ASSERT_TRUE(first->send(request));
  ASSERT_TRUE(first->reply());
  ASSERT_TRUE(second.send(request));
  ASSERT_TRUE(second.reply());
  const auto third = house.ask("GET /", house.host_line() + house.cookie_line());
  ASSERT_TRUE(third);
  EXPECT_EQ(third->status, 503);
  first.reset();
  // When the server notices is its own affair.
  while (house.status("GET /", house.host_line() + house.cookie_line()) != 200) std::this_thread::yield();
}

TEST(Server, StrangersDoNotKeepOutWhoHasTheToken) {
  ServerOptions options;
  options.connections = 4;
  House house({}, options);
  SocketClient guest = house.guest();
  house.room.wait_entered(1);
  std::vector<Client> strangers;
  strangers.reserve(20);
  for (int i = 0; i < 20; ++i) strangers.emplace_back(house.server.port());
  EXPECT_EQ(house.status("GET /", house.host_line() + house.cookie_line()), 200);
  EXPECT_TRUE(strangers.front().ends());
  // Who is known is not sent away for them.
  ASSERT_TRUE(guest.send_text("hello"));
  EXPECT_TRUE(guest.message());
}

TEST(Server, ManyConnectionsAtOnceEndNothing) {
  Limits limits;
  limits.linger = milliseconds(100);
  const House house(limits);
  std::vector<Client> crowd;
  crowd.reserve(100);
  for (int i = 0; i < 100; ++i) crowd.emplace_back(house.server.port());
  int ended = 0;
  for (Client& client : crowd) {
    client.send("GET / HTTP/1.1\r\n\r\n");
    const auto reply = client.reply();
    ended += reply ? 0 : 1;
    EXPECT_TRUE(client.ends());
  }
  EXPECT_GT(ended, 0);
  while (house.status("GET /", house.host_line() + house.cookie_line()) != 200) std::this_thread::yield();
}

TEST(Server, EndsAtOnceWithOpenConnections) {
  std::optional<House> house(std::in_place);
  Client silent(house->server.port());
  Client halfway(house->server.port());
  halfway.send("GET /");
  SocketClient guest = house->guest();
  house->room.wait_entered(1);
  house.reset();
  EXPECT_TRUE(silent.ends());
  EXPECT_TRUE(halfway.ends());
  EXPECT_TRUE(guest.client().ends());
}

TEST(Server, EveryGuestHasLeftWhenItHasEnded) {
  EchoRoom room;
  std::optional<House> house(std::in_place, Limits{}, ServerOptions{}, &room);
  const SocketClient first = house->guest();
  const SocketClient second = house->guest();
  room.wait_entered(2);
  house.reset();
  EXPECT_EQ(room.left().size(), 2U);
}

TEST(Server, APortThatIsTakenIsSaidInWords) {
  const House house;
  ServerOptions options;
  options.port = house.server.port();
  EchoRoom room;
  try {
    const Server second(options, House::page, room);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(std::to_string(options.port) + ", which another program has"));
  }
}

TEST(Server, AnAddressOfAnotherMachineIsSaidInWords) {
  ServerOptions options;
  options.bind = "192.0.2.1";
  EchoRoom room;
  EXPECT_THROW(Server(options, House::page, room), InputError);
}

TEST(Server, WhereAnybodyMayAskTheTokenIsAskedForToo) {
  ServerOptions options;
  options.bind = "0.0.0.0";
  const House house({}, options);
  EXPECT_EQ(house.server.address().find("http://127.0.0.1:"), 0U);
  EXPECT_EQ(house.status("GET /", house.host_line()), 403);
  EXPECT_EQ(house.status("GET /", "Host: 0.0.0.0:" + std::to_string(house.server.port()) + "\r\n"), 421);
  EXPECT_EQ(house.status("GET /?token=" + house.token, house.host_line()), 200);
}

TEST(Server, TokensDiffer) { EXPECT_NE(House().token, House().token); }

}  // namespace
}  // namespace traceflow::serve

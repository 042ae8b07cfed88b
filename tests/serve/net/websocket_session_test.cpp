#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "serve/net/test_server.h"

namespace traceflow::serve {
namespace {

using std::chrono::milliseconds;

Outgoing outgoing(std::string text, bool binary = false) {
  return {std::make_shared<const std::string>(std::move(text)), binary};
}

// No limit of time but those that a test sets: what else would end a connection must not.
Limits patient() {
  Limits limits;
  limits.request = limits.piece = limits.silence = std::chrono::hours(1);
  limits.linger = milliseconds(100);
  return limits;
}

int close_code(const std::optional<Frame>& frame) {
  if (!frame || frame->opcode != 8 || frame->payload.size() < 2) return 0;
  return static_cast<unsigned char>(frame->payload[0]) << 8 | static_cast<unsigned char>(frame->payload[1]);
}

TEST(Socket, WelcomesThePage) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  ASSERT_TRUE(client.welcome());
  EXPECT_EQ(client.welcome()->status, 101);
  const auto& fields = client.welcome()->fields;
  EXPECT_EQ(fields.at("sec-websocket-accept"), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
  EXPECT_EQ(fields.at("x-content-type-options"), "nosniff");
  EXPECT_EQ(fields.at("cache-control"), "no-store");
  EXPECT_FALSE(fields.contains("sec-websocket-extensions"));
}

TEST(Socket, WelcomesNobodyElse) {
  const TestServer test_server;
  const std::string host = test_server.host_line();
  const std::string origin = test_server.origin_line();
  const std::string cookie = test_server.cookie_line();
  const auto status = [&](const std::string& lines) {
    const WebSocketClient client(test_server.server.port(), lines);
    return client.welcome() ? client.welcome()->status : 0;
  };
  EXPECT_EQ(status(host + origin), 403);
  EXPECT_EQ(status(host + cookie), 403);
  EXPECT_EQ(status(origin + cookie), 400);
  EXPECT_EQ(status(host + cookie + "Origin: null\r\n"), 403);
  EXPECT_EQ(status(host + cookie + "Origin: http://evil.example\r\n"), 403);
  EXPECT_EQ(status(host + cookie + "Origin: http://127.0.0.1\r\n"), 403);
  EXPECT_EQ(status(host + cookie + origin + origin), 403);
  EXPECT_EQ(status(host + cookie + origin + "Sec-Fetch-Site: cross-site\r\n"), 403);
  EXPECT_EQ(status("Host: evil.example\r\n" + origin + cookie), 421);
  EXPECT_EQ(status(host + origin + cookie + "Content-Length: 3\r\n"), 413);
  EXPECT_EQ(test_server.status("GET /ws", host + cookie), 426);
  EXPECT_EQ(test_server.status("GET /ws?token=" + test_server.token, host), 403);
  const std::string upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\n";
  EXPECT_EQ(test_server.status("GET /", host + origin + cookie + upgrade), 404);
  EXPECT_EQ(test_server.status("GET /?token=" + test_server.token, host + origin + upgrade), 403);
  // Of the right origin, but not by the protocol.
  EXPECT_EQ(test_server.status("GET /ws", host + origin + cookie + upgrade), 400);
}

TEST(Socket, NobodySpeaksBeforeTheWelcome) {
  const TestServer test_server;
  HttpClient client(test_server.server.port());
  client.send(
      "GET /ws HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
      test_server.host_line() + test_server.origin_line() + test_server.cookie_line() + "\r\n\x81");
  const auto reply = client.reply();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 400);
}

TEST(Socket, ARefusedHandshakeHasTheSafetyFieldsToo) {
  const TestServer test_server;
  const auto reply = test_server.ask("GET /ws", test_server.host_line() + test_server.origin_line() +
                                                    test_server.cookie_line() +
                                                    "Upgrade: websocket\r\nConnection: Upgrade\r\n");
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->fields.at("cross-origin-resource-policy"), "same-origin");
}

TEST(Socket, CarriesMessagesBothWays) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  client.send_text("hello");
  auto back = client.message();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->opcode, 1);
  EXPECT_EQ(back->payload, "hello");
  test_server.handler.send_to(1)(outgoing(std::string("\0\1\xFF", 3), true));
  back = client.message();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->opcode, 2);
  EXPECT_EQ(back->payload, std::string("\0\1\xFF", 3));
  test_server.handler.send_to(1)(outgoing(""));
  back = client.message();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->opcode, 1);
  EXPECT_EQ(back->payload, "");
}

TEST(Socket, PutsTogetherWhatComesInParts) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  client.send_frame(1, "one ", false);
  client.send_frame(9, "still there?");
  client.send_frame(0, "two");
  const auto pong = client.frame();
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->opcode, 10);
  EXPECT_EQ(pong->payload, "still there?");
  const auto back = client.message();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->payload, "one two");
}

TEST(Socket, CarriesBigPictures) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  test_server.handler.wait_entered(1);
  std::string picture(5'000'001, '\0');
  for (size_t i = 0; i < picture.size(); ++i) picture[i] = static_cast<char>(i * i >> 3);
  test_server.handler.send_to(1)(outgoing(picture, true));
  test_server.handler.send_to(1)(outgoing("after"));
  auto back = client.message();
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->payload == picture);
  back = client.message();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->payload, "after");
}

TEST(Socket, KeepsTheOrderOfThousandsFromSeveralThreads) {
  Limits limits = patient();
  limits.waiting_messages = 100'000;
  TestServer test_server(limits);
  WebSocketClient client = test_server.client();
  test_server.handler.wait_entered(1);
  constexpr int threads = 4;
  constexpr int count = 2000;
  std::vector<std::thread> writers;
  writers.reserve(threads);
  for (int t = 0; t < threads; ++t) {
    writers.emplace_back([send = test_server.handler.send_to(1), t] {
      for (int i = 0; i < count; ++i) send(outgoing(std::to_string(t) + " " + std::to_string(i)));
    });
  }
  std::vector<int> next(threads, 0);
  for (int i = 0; i < threads * count; ++i) {
    const auto message = client.message();
    ASSERT_TRUE(message);
    const int t = std::stoi(message->payload);
    EXPECT_EQ(message->payload, std::to_string(t) + " " + std::to_string(next.at(static_cast<size_t>(t))++));
  }
  for (std::thread& writer : writers) writer.join();
}

TEST(Socket, KeepsTheOrderOfWhatItHears) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  constexpr int count = 3000;
  std::thread writer([&] {
    for (int i = 0; i < count; ++i) client.send_text(std::to_string(i));
  });
  for (int i = 0; i < count; ++i) {
    const auto message = client.message();
    ASSERT_TRUE(message);
    EXPECT_EQ(message->payload, std::to_string(i));
  }
  writer.join();
}

TEST(Socket, ClosesWithAReasonWhenTheRoomThrows) {
  TestServer test_server;
  WebSocketClient other = test_server.client();
  test_server.handler.wait_entered(1);
  WebSocketClient client = test_server.client();
  client.send_text("throw");
  const auto farewell = client.message();
  EXPECT_EQ(close_code(farewell), 1011);
  EXPECT_EQ(farewell->payload.substr(2), "asked to throw");
  test_server.handler.wait_left(1);
  EXPECT_EQ(test_server.handler.left(), std::vector<uint64_t>{2});
  other.send_text("the others stay");
  const auto back = other.message();
  ASSERT_TRUE(back);
  EXPECT_EQ(back->payload, "the others stay");
}

TEST(Socket, RefusesMessagesThatAreNotText) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  client.send_frame(2, "bytes");
  EXPECT_EQ(close_code(client.message()), 1003);
  test_server.handler.wait_left(1);
}

TEST(Socket, RefusesWhatBreaksTheProtocol) {
  TestServer test_server(patient());
  const auto code_after = [&](auto send) {
    WebSocketClient client = test_server.client();
    send(client);
    const auto farewell = client.message();
    EXPECT_TRUE(client.client().ends());
    return close_code(farewell);
  };
  EXPECT_EQ(
      code_after([](WebSocketClient& c) { c.send_text(std::string(64 << 10, 'x')), c.send_text("throw"); }),
      0);
  EXPECT_EQ(code_after([](WebSocketClient& c) { c.send_text(std::string((64 << 10) + 1, 'x')); }), 1009);
  EXPECT_EQ(code_after([](WebSocketClient& c) { c.send_frame(1, "not masked", true, false); }), 1002);
  EXPECT_EQ(code_after([](WebSocketClient& c) { c.send_frame(3, "no such kind"); }), 1002);
  EXPECT_EQ(code_after([](WebSocketClient& c) { c.send_frame(0, "goes on with nothing"); }), 1002);
  EXPECT_EQ(code_after([](WebSocketClient& c) { c.send_text("\xC0\xAF"); }), 1007);
  test_server.handler.wait_left(6);
}

TEST(Socket, AGuestThatClosesHasLeft) {
  TestServer test_server;
  WebSocketClient client = test_server.client();
  test_server.handler.wait_entered(1);
  client.send_frame(8, std::string("\x03\xE8", 2));
  EXPECT_EQ(close_code(client.message()), 1000);
  EXPECT_TRUE(client.client().ends());
  test_server.handler.wait_left(1);
}

TEST(Socket, AGuestThatVanishesHasLeft) {
  TestServer test_server;
  { const WebSocketClient client = test_server.client(); }
  test_server.handler.wait_left(1);
  test_server.handler.send_to(1)(outgoing("to nobody"));
  EXPECT_EQ(test_server.handler.left(), std::vector<uint64_t>{1});
}

TEST(Socket, SendingIsHarmlessWhenTheServerIsGone) {
  EchoHandler handler;
  Limits limits;
  limits.waiting_messages = 100'000;  // none is lost for being too many
  std::optional<TestServer> test_server(std::in_place, limits, ServerOptions{}, &handler);
  WebSocketClient client = test_server->client();
  handler.wait_entered(1);
  const Send send = handler.send_to(1);
  std::thread writer([send] {
    for (int i = 0; i < 20'000; ++i) send(outgoing(std::to_string(i)));
  });
  test_server.reset();
  writer.join();
  EXPECT_EQ(handler.left(), std::vector<uint64_t>{1});
  const Outgoing late = outgoing("to nobody");
  send(late);
  EXPECT_EQ(late.bytes.use_count(), 1) << "what cannot be sent is not kept";
  // What came to the client is the beginning of what was sent.
  int heard = 0;
  for (auto message = client.message(); message; message = client.message())
    EXPECT_EQ(message->payload, std::to_string(heard++));
  EXPECT_TRUE(client.client().ends());
}

TEST(Socket, DropsAGuestThatDoesNotAnswerPings) {
  Limits limits = patient();
  limits.silence = milliseconds(200);
  TestServer test_server(limits);
  WebSocketClient deaf = test_server.client();
  test_server.handler.wait_left(1);
  const auto ping = deaf.frame();
  ASSERT_TRUE(ping);
  EXPECT_EQ(ping->opcode, 9);
  EXPECT_TRUE(deaf.client().ends());
}

TEST(Socket, DropsAGuestThatDoesNotRead) {
  Limits limits = patient();
  limits.piece = milliseconds(200);
  TestServer test_server(limits);
  WebSocketClient idle = test_server.client();
  test_server.handler.wait_entered(1);
  test_server.handler.send_to(1)(outgoing(std::string(100 << 20, 'x'), true));
  test_server.handler.wait_left(1);
}

TEST(Socket, DropsAGuestForWhomTooMuchWaits) {
  Limits limits = patient();
  limits.waiting_messages = 10;
  TestServer test_server(limits);
  WebSocketClient slow = test_server.client();
  test_server.handler.wait_entered(1);
  const Send send = test_server.handler.send_to(1);
  // The first is more than the system's buffers hold.
  send(outgoing(std::string(100 << 20, 'x'), true));
  for (int i = 0; i < 20; ++i) send(outgoing("more"));
  test_server.handler.wait_left(1);
}

TEST(Socket, DropsAHandshakeThatTricklesIn) {
  Limits limits = patient();
  limits.request = milliseconds(200);
  const TestServer test_server(limits);
  HttpClient slow(test_server.server.port());
  slow.send("GET /ws HTTP/1.1\r\nUpgrade: websocket\r\n" + test_server.host_line());
  int bytes = 0;
  while (bytes < 2000 && slow.send("x")) {
    std::this_thread::sleep_for(milliseconds(5));
    ++bytes;
  }
  EXPECT_LT(bytes, 2000);
}

}  // namespace
}  // namespace traceflow::serve

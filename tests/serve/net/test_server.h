#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <stdexcept>
#include <vector>

#include "serve/net/client.h"
#include "serve/net/server.h"

namespace traceflow::serve {

// A handler that sends back what it hears, and remembers who came and went.
class EchoHandler : public MessageHandler {
 public:
  void on_connect(uint64_t client, Send send) override {
    const std::lock_guard lock(mutex_);
    clients_[client] = std::move(send);
    ++entered_;
    changed_.notify_all();
  }
  void on_message(uint64_t client, std::string_view text) override {
    if (text == "throw") throw std::runtime_error("asked to throw");
    const std::lock_guard lock(mutex_);
    clients_.at(client)({std::make_shared<const std::string>(text), false});
  }
  void on_disconnect(uint64_t client) override {
    const std::lock_guard lock(mutex_);
    left_.push_back(client);
    changed_.notify_all();
  }

  // Waits until so many have entered or left in all.
  void wait_entered(size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return entered_ >= count; });
  }
  void wait_left(size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return left_.size() >= count; });
  }
  std::vector<uint64_t> left() {
    const std::lock_guard lock(mutex_);
    return left_;
  }
  // Kept after they left.
  Send send_to(uint64_t client) {
    const std::lock_guard lock(mutex_);
    return clients_.at(client);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, Send> clients_;
  size_t entered_ = 0;
  std::vector<uint64_t> left_;
};

// A server with a page of two files, and what a client of it says.
struct TestServer {
  // elsewhere: a handler to serve instead of its own.
  explicit TestServer(const Limits& limits = {}, const ServerOptions& options = {},
                      EchoHandler* elsewhere = nullptr)
      : server(options, page, elsewhere != nullptr ? *elsewhere : handler, limits),
        token(server.address().substr(server.address().find('=') + 1)) {}

  static constexpr unsigned char html[] = {'<', 'p', '>', 'h', 'i'};
  static constexpr unsigned char script[] = {'1', ';'};
  static constexpr EmbeddedFile page[] = {{"index.html", html}, {"viewer.js", script}};

  std::string host_line() const { return "Host: 127.0.0.1:" + std::to_string(server.port()) + "\r\n"; }
  std::string origin_line() const {
    return "Origin: http://127.0.0.1:" + std::to_string(server.port()) + "\r\n";
  }
  std::string cookie_line() const {
    return "Cookie: traceflow_" + std::to_string(server.port()) + "=" + token + "\r\n";
  }
  // One request on a connection of its own; lines end in \r\n.
  std::optional<Reply> ask(const std::string& first, const std::string& lines) const {
    HttpClient client(server.port());
    client.send(first + " HTTP/1.1\r\n" + lines + "\r\n");
    return client.reply(!first.starts_with("HEAD"));
  }
  int status(const std::string& first, const std::string& lines) const {
    const auto reply = ask(first, lines);
    return reply ? reply->status : 0;
  }
  WebSocketClient client() const { return {server.port(), host_line() + origin_line() + cookie_line()}; }

  EchoHandler handler;
  Server server;
  std::string token;
};

}  // namespace traceflow::serve

#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace traceflow::serve {

struct Reply {
  int status = 0;
  std::map<std::string, std::string>
      fields;  // names in small letters; what is given twice is joined by " | "
  std::string body;
};

// A client made of a plain socket, which says exactly what it is told to. Waits 20 s for an answer at most.
class HttpClient {
 public:
  explicit HttpClient(int port);
  ~HttpClient();
  HttpClient(HttpClient&& other) noexcept
      : handle_(std::exchange(other.handle_, -1)), unread_(std::move(other.unread_)) {}
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;
  HttpClient& operator=(HttpClient&&) = delete;

  // False when the connection is gone.
  bool send(std::string_view bytes);
  // Nothing when the connection ended first.
  std::optional<Reply> reply(bool body = true);
  // Whether the other side ends the connection, after whatever it still sends.
  bool ends();
  // Exactly so many bytes, or nothing.
  std::optional<std::string> bytes(size_t count);

 private:
  bool more();

  int handle_;
  std::string unread_;
};

struct Frame {
  int opcode;
  bool last;
  std::string payload;
};

// The client's half of RFC 6455, by hand.
class WebSocketClient {
 public:
  // Sends the upgrade request with these lines, each ending in \r\n, beside those that make it one.
  WebSocketClient(int port, const std::string& lines);

  const std::optional<Reply>& welcome() const { return welcome_; }
  bool send_text(std::string_view text) { return send_frame(1, text); }
  bool send_frame(int opcode, std::string_view payload, bool last = true, bool masked = true);
  // Nothing when the connection ended first.
  std::optional<Frame> frame();
  // The next whole message, whatever else comes in between; a closing one comes as its frame does.
  std::optional<Frame> message();
  HttpClient& client() { return client_; }

 private:
  HttpClient client_;
  std::optional<Reply> welcome_;
};

}  // namespace traceflow::serve

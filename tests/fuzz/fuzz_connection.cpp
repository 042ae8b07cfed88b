// Bytes as all that a client says on a connection, WebSocket included. The first byte says in what pieces
// they come.
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>

#include "fuzz/http_checks.h"
#include "serve/net/http_session.h"

using namespace traceflow;

namespace {

// Echoes, keeps account of who is here, and throws when it is told to.
class FuzzRoom : public serve::MessageHandler {
 public:
  void on_connect(uint64_t client, serve::Send send) override {
    fuzz::promise(clients_.insert(client).second, "a client enters once");
    send_ = std::move(send);
    ++entered;
  }
  void on_message(uint64_t client, std::string_view text) override {
    fuzz::promise(clients_.contains(client), "who speaks is here");
    fuzz::promise(text.size() <= serve::Limits().message_bytes, "no long message is heard");
    if (text == "throw") throw std::runtime_error(std::string(200, 'x'));
    send_({std::make_shared<const std::string>(text), text.starts_with("b")});
  }
  void on_disconnect(uint64_t client) override {
    fuzz::promise(clients_.erase(client) == 1, "a client leaves once");
  }

  bool empty() const { return clients_.empty(); }
  int entered = 0;

 private:
  std::set<uint64_t> clients_;
  serve::Send send_;
};

// The client's end of a connection.
class Caller {
 public:
  Caller() {
    fuzz::promise(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends_.data()) == 0, "socketpair");
  }
  ~Caller() { close(ends_[1]); }
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;

  int other_end() const { return ends_[0]; }
  void say(std::string_view bytes) { (void)!::send(ends_[1], bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  void hang_up() { shutdown(ends_[1], SHUT_WR); }
  // Whether there was anything.
  bool listen() {
    std::array<char, 65536> bytes;
    const ssize_t got = recv(ends_[1], bytes.data(), bytes.size(), 0);
    if (got > 0) heard.append(bytes.data(), static_cast<size_t>(got));
    return got > 0;
  }

  std::string heard;

 private:
  std::array<int, 2> ends_{};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  static boost::asio::io_context io(1);
  const bool full = data[0] == 255;
  const size_t piece = data[0] == 0 ? size : data[0];
  const std::string_view asked(reinterpret_cast<const char*>(data + 1), size - 1);

  FuzzRoom handler;
  serve::SharedState shared{fuzz::request_guard(), fuzz::page, handler, {}};
  Caller caller;
  const auto live = [&] {
    io.restart();
    while (io.poll() > 0 || caller.listen()) {
    }
  };
  serve::Stream stream(io.get_executor(), boost::asio::generic::stream_protocol(AF_UNIX, 0),
                       caller.other_end());
  shared.sessions.push_back(serve::start_http_session(std::move(stream), shared, full));
  for (size_t at = 0; at < asked.size(); at += piece) {
    caller.say(asked.substr(at, piece));
    live();
  }
  caller.hang_up();
  live();

  fuzz::promise(
      std::all_of(shared.sessions.begin(), shared.sessions.end(), [](const auto& s) { return s.expired(); }),
      "a closed connection is destroyed");
  fuzz::promise(handler.empty(), "every closed connection has disconnected");
  const size_t end = caller.heard.find("\r\n\r\n");
  fuzz::promise(caller.heard.empty() || end != std::string::npos, "an answer is whole");
  if (end != std::string::npos) fuzz::check_head(std::string_view(caller.heard).substr(0, end + 2), asked);
  fuzz::promise(handler.entered == 0 || asked.find(fuzz::token) != std::string_view::npos,
                "no client without the token connects");
  const bool long_head = asked.substr(0, asked.find("\r\n\r\n")).size() > serve::Limits().header_bytes;
  fuzz::promise(!long_head || !caller.heard.starts_with("HTTP/1.1 200"), "no long header is read");
  fuzz::promise(!full || caller.heard.empty() || caller.heard.starts_with("HTTP/1.1 503") ||
                    caller.heard.starts_with("HTTP/1.1 4"),
                "no connection above the limit is served");
  return 0;
}

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace traceflow::serve {

// A message to one page. Shared, since a message to all pages is built once.
struct Outgoing {
  std::shared_ptr<const std::string> bytes;
  bool binary = false;
};

// Sends a message to a page. Callable from any thread; returns at once; does nothing once the connection is
// closed.
using Send = std::function<void(Outgoing)>;

// Handles the events of the server's WebSocket connections. All functions are called on the network thread,
// so each must return soon. An exception closes only that connection, with its text as the reason.
class MessageHandler {
 public:
  virtual ~MessageHandler() = default;
  // A page has connected. Its number is never reused.
  virtual void on_connect(uint64_t client, Send send) = 0;
  // The page has sent a text message.
  virtual void on_message(uint64_t client, std::string_view text) = 0;
  // The connection has ended. Called once for every on_connect, even if that threw.
  virtual void on_disconnect(uint64_t client) = 0;
};

}  // namespace traceflow::serve

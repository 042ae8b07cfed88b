#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace traceflow::serve {

// A message to one page. Shared, because what goes to all pages is made once.
struct Outgoing {
  std::shared_ptr<const std::string> bytes;
  bool binary = false;
};

// Hands a message to a page's connection. Callable from any thread; returns at once; does nothing once the
// connection is gone.
using Send = std::function<void(Outgoing)>;

// Handles the events of the server's WebSocket connections. The network thread calls every function, so each
// must return soon. An exception closes that connection alone, with its text as the reason.
class MessageHandler {
 public:
  virtual ~MessageHandler() = default;
  // A page has connected. Its number is never used again.
  virtual void on_connect(uint64_t client, Send send) = 0;
  // The page has sent a text message.
  virtual void on_message(uint64_t client, std::string_view text) = 0;
  // The connection has ended. Called once for every on_connect, also where that threw.
  virtual void on_disconnect(uint64_t client) = 0;
};

}  // namespace traceflow::serve

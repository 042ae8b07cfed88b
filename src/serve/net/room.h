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

// Whom the server's connections talk to. Everything is called on the network's thread and must return soon.
// What it throws ends that connection, with the words as the reason, and nothing else.
class Room {
 public:
  virtual ~Room() = default;
  // A page has connected. The guest's number is never used again.
  virtual void enter(uint64_t guest, Send send) = 0;
  // A text message of it.
  virtual void hear(uint64_t guest, std::string_view text) = 0;
  // Its connection has ended. Once for every enter, also for one that threw.
  virtual void leave(uint64_t guest) = 0;
};

}  // namespace traceflow::serve

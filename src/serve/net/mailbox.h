#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>

#include "serve/net/message_handler.h"

namespace traceflow::serve {

// A bounded queue of messages to one page. Any thread puts messages in; the network thread takes them out.
class Mailbox {
 public:
  // messages, bytes: the capacity; the message that reaches it is still accepted. wake: called by the thread
  // that puts a message into the empty, open queue; must return at once and not use the queue.
  Mailbox(size_t messages, size_t bytes, std::function<void()> wake);

  void put(Outgoing message);
  std::optional<Outgoing> take();
  // Whether messages were lost because the queue was full.
  bool overflowed() const;
  // After this, put() does nothing and wake is not called.
  void close();

 private:
  mutable std::mutex mutex_;
  std::function<void()> wake_;
  std::deque<Outgoing> waiting_;
  size_t message_cap_;
  size_t byte_cap_;
  size_t bytes_ = 0;
  bool overflowed_ = false;
  bool open_ = true;
};

}  // namespace traceflow::serve

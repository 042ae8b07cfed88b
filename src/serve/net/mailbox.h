#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>

#include "serve/net/room.h"

namespace traceflow::serve {

// Messages on their way to one page: put in by any thread, taken out by the network's.
class Mailbox {
 public:
  // messages, bytes: what may wait; the message that fills the box still fits. wake: called, while the box is
  // open, when there is something to do after there was nothing, from the thread that puts it in; must return
  // at once and not touch the box.
  Mailbox(size_t messages, size_t bytes, std::function<void()> wake);

  void put(Outgoing message);
  std::optional<Outgoing> take();
  // Whether more was put in than may wait. What waits then is not of use any more.
  bool overflowed() const;
  // From now on nothing is put in, and wake is not called.
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

#include "serve/net/mailbox.h"

namespace traceflow::serve {

Mailbox::Mailbox(size_t messages, size_t bytes, std::function<void()> wake)
    : wake_(std::move(wake)), message_cap_(messages), byte_cap_(bytes) {}

void Mailbox::put(Outgoing message) {
  if (!message.bytes) return;
  const std::lock_guard lock(mutex_);
  if (!open_ || overflowed_) return;
  overflowed_ = waiting_.size() >= message_cap_ || bytes_ >= byte_cap_;
  const bool idle = waiting_.empty();
  if (!overflowed_) {
    bytes_ += message.bytes->size();
    waiting_.push_back(std::move(message));
  }
  // With the lock held, so that wake is never called after close().
  if (idle || overflowed_) wake_();
}

std::optional<Outgoing> Mailbox::take() {
  const std::lock_guard lock(mutex_);
  if (waiting_.empty()) return std::nullopt;
  Outgoing message = std::move(waiting_.front());
  waiting_.pop_front();
  bytes_ -= message.bytes->size();
  return message;
}

bool Mailbox::overflowed() const {
  const std::lock_guard lock(mutex_);
  return overflowed_;
}

void Mailbox::close() {
  const std::lock_guard lock(mutex_);
  open_ = false;
  waiting_.clear();
}

}  // namespace traceflow::serve

#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

namespace traceflow {

// Thrown where the user has asked to stop; nothing is lost by it.
struct Stopped {};

// Long work that somebody waits for, who may stop it and is told how far it is.
class Work {
 public:
  // So many of all are done; all is 0 where that is not known.
  using Progress = std::function<void(int64_t done, int64_t all)>;

  // Implicit: whoever may stop a piece of work need not listen to it.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Work(
      const std::atomic<bool>& stop, Progress progress = [](int64_t, int64_t) {})
      : stop_(&stop), progress_(std::move(progress)) {}

  const std::atomic<bool>& stop() const { return *stop_; }
  // Throws Stopped where that was asked for.
  void check() const {
    if (*stop_) throw Stopped{};
  }
  // May be called from several threads.
  void tell(int64_t done, int64_t all) const {
    const std::lock_guard lock(telling_);
    progress_(done, all);
  }

 private:
  const std::atomic<bool>* stop_;
  Progress progress_;
  mutable std::mutex telling_;
};

}  // namespace traceflow

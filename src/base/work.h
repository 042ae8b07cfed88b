#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

namespace traceflow {

// Thrown when the user has asked to stop; no work is lost.
struct Stopped {};

// Long work whose caller may stop it and is told its progress.
class Work {
 public:
  // Progress: `done` of `all`; all is 0 if unknown.
  using Progress = std::function<void(int64_t done, int64_t all)>;

  // Implicit, because not every caller wants to listen to progress.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Work(
      const std::atomic<bool>& stop, Progress progress = [](int64_t, int64_t) {})
      : stop_(&stop), progress_(std::move(progress)) {}

  const std::atomic<bool>& stop() const { return *stop_; }
  // Throws Stopped if the caller has asked to stop.
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

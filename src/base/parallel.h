#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <mutex>
#include <vector>

#include "base/device.h"
#include "base/error.h"
#include "base/profile.h"

namespace traceflow {

// Number of threads of parallel loops. 0: OMP_NUM_THREADS, or all cores if it is not set.
void set_threads(int count);
int thread_count();
// Whether the caller runs inside a loop that several threads share.
bool in_parallel_loop();

namespace detail {

// Carries an exception out of an OpenMP region, since exceptions must not leave one. It is that of the first
// block that fails, at any number of threads. Blocks after a failed one are not run.
class ExceptionBridge {
 public:
  template <class F>
  void run(int64_t block, F&& f) noexcept {
    if (block > failed_.load(std::memory_order_relaxed)) return;
    try {
      f();
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (block >= failed_.load(std::memory_order_relaxed)) return;
      exception_ = std::current_exception();
      failed_.store(block, std::memory_order_relaxed);
    }
  }
  void rethrow() {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  std::atomic<int64_t> failed_{std::numeric_limits<int64_t>::max()};
  std::mutex mutex_;
  std::exception_ptr exception_;
};

#ifdef __SANITIZE_THREAD__
// Calls run(block) for every block; allocates memory. The thread sanitizer does not see how OpenMP's runtime
// orders its threads and reports a race at the end of every loop. Under it the blocks run on threads that it
// does see.
void deal_to_plain_threads(int64_t blocks, const std::function<void(int64_t)>& run);
#endif

}  // namespace detail

// Calls f(begin, end) over [0, n) in blocks of `grain`, which idle threads take in turn. Which elements share
// a block never depends on the number of threads, so a sum kept per block and added in block order has the
// same bytes at any number. Rethrows the exception of the first block that throws.
template <class F>
void parallel_blocks(const char* description, int64_t n, int64_t grain, F&& f) {
  if (n <= 0) return;
  const profile::Scope scope(description);
  const int64_t blocks = (n + grain - 1) / grain;
  detail::ExceptionBridge bridge;
  const auto run = [&](int64_t block) {
    bridge.run(block, [&] { f(block * grain, std::min(n, (block + 1) * grain)); });
  };
#ifdef __SANITIZE_THREAD__
  if (blocks > 1 && thread_count() > 1) {
    detail::deal_to_plain_threads(blocks, run);
  } else {
    for (int64_t block = 0; block < blocks; ++block) run(block);
  }
#else
#pragma omp parallel for schedule(dynamic, 1) num_threads(thread_count()) if (blocks > 1)
  for (int64_t block = 0; block < blocks; ++block) run(block);
#endif
  bridge.rethrow();
}

// Calls f(i) for every i in [0, n), for element-wise steps.
template <class F>
void parallel_for(const char* description, int64_t n, F&& f, int64_t grain = 1024) {
  parallel_blocks(description, n, grain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) f(i);
  });
}

namespace cuda {
// Calls f(i) for every i in [0, n) in a kernel. Defined in base/kernel.h; the .cu file beside a functor
// instantiates it.
template <class F>
TRACEFLOW_WITH_CUDA void for_each_index(const char* description, int64_t n, const F& f);
}  // namespace cuda

// For element-wise steps of ops that run on any device. f is a functor of plain numbers and addresses with a
// TRACEFLOW_HD operator().
template <class F>
void parallel_for(Device device, const char* description, int64_t n, const F& f, int64_t grain = 1024) {
  if (device == Device::cpu) {
    parallel_for(description, n, f, grain);
    return;
  }
  void (*const for_each)(const char*, int64_t, const F&) = &cuda::for_each_index<F>;
  require(for_each != nullptr, "a step has code for the CUDA device", description);
  for_each(description, n, f);
}

// Sum of f(i) over [0, n) in a fixed order: first within blocks of `grain`, then over the blocks.
template <class T, class F>
T ordered_sum(const char* description, int64_t n, F&& f, int64_t grain = 4096) {
  std::vector<T> partial(static_cast<size_t>((n + grain - 1) / grain), T{});
  parallel_blocks(description, n, grain, [&](int64_t begin, int64_t end) {
    T sum{};
    for (int64_t i = begin; i < end; ++i) sum += f(i);
    partial[static_cast<size_t>(begin / grain)] = sum;
  });
  T total{};
  for (const T& p : partial) total += p;
  return total;
}

}  // namespace traceflow

#include "base/parallel.h"

#include <omp.h>

#include <atomic>
#include <thread>

namespace traceflow {

namespace {
int chosen_threads = 0;
}  // namespace

void set_threads(int count) { chosen_threads = std::max(0, count); }

int thread_count() { return chosen_threads > 0 ? chosen_threads : omp_get_max_threads(); }

#ifdef __SANITIZE_THREAD__

namespace {
thread_local bool in_loop = false;
}  // namespace

bool in_parallel_loop() { return in_loop; }

void detail::deal_to_plain_threads(int64_t blocks, const std::function<void(int64_t)>& run) {
  const int64_t threads = in_loop ? 1 : std::min<int64_t>(blocks, thread_count());
  std::atomic<int64_t> next{0};
  const auto work = [&] {
    in_loop = in_loop || threads > 1;
    // Relaxed on purpose: a stronger order would synchronise the blocks of different threads, and hide their
    // races from the sanitizer.
    for (int64_t block; (block = next.fetch_add(1, std::memory_order_relaxed)) < blocks;) run(block);
  };
  const bool outside = !in_loop;
  std::vector<std::thread> others;
  for (int64_t i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
  if (outside) in_loop = false;
}

#else

bool in_parallel_loop() { return omp_in_parallel() != 0; }

#endif

}  // namespace traceflow

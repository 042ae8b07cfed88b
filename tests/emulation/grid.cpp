#include "emulation/grid.h"

#include <boost/context/fiber.hpp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

namespace traceflow::emulation {

namespace {

namespace context = boost::context;

// Stacks of fibers that have ended, for those to come.
class StackPool {
 public:
  context::stack_context allocate() {
    if (free_.empty()) return context::fixedsize_stack(stack_bytes).allocate();
    const context::stack_context stack = free_.back();
    free_.pop_back();
    return stack;
  }
  void deallocate(context::stack_context& stack) { free_.push_back(stack); }

 private:
  static constexpr size_t stack_bytes = size_t{128} << 10;
  std::vector<context::stack_context> free_;
};

StackPool& stacks() {
  static StackPool pool;
  return pool;
}

struct PooledStack {
  context::stack_context allocate() const { return stacks().allocate(); }
  void deallocate(context::stack_context& stack) const { stacks().deallocate(stack); }
};

struct Warp {
  WarpValues incoming{};
  unsigned mask = 0;     // of the exchange under way
  unsigned arrived = 0;  // lanes that have come
  int generation = 0;
};

struct Thread {
  ThreadState state;
  context::fiber fiber;
  WarpValues received{};  // of the last exchange
  bool ended = false;
};

class Block {
 public:
  Block(const char* kernel, Size3 grid, Size3 size, Index3 index, const std::function<void()>& body,
        uint64_t& shuffle)
      : kernel_(kernel), body_(body), shuffle_(shuffle), threads_(size_t{size.x} * size.y * size.z) {
    warps_.resize((threads_.size() + warp_size - 1) / warp_size);
    for (size_t i = 0; i < threads_.size(); ++i) {
      const auto flat = static_cast<unsigned>(i);
      threads_[i].state = {{flat % size.x, flat / size.x % size.y, flat / size.x / size.y},
                           index,
                           size,
                           grid,
                           static_cast<int>(i % warp_size)};
    }
  }

  void run();
  const ThreadState& current() const { return threads_[running_].state; }

  [[noreturn]] void fail(const char* what) const {
    const ThreadState& t = threads_[running_].state;
    std::fprintf(stderr, "emulation: %s: %s (block %u %u %u, thread %u %u %u)\n", kernel_, what, t.block.x,
                 t.block.y, t.block.z, t.thread.x, t.thread.y, t.thread.z);
    std::abort();
  }

  // Waits until all threads that have not ended are here; returns for how many the predicate held.
  int barrier(bool predicate) {
    const int generation = barrier_generation_;
    ++barrier_arrived_;
    if (predicate) ++barrier_count_;
    release_barrier();
    while (barrier_generation_ == generation) yield();
    return barrier_result_;
  }

  WarpValues exchange(unsigned mask, const void* value, size_t bytes) {
    const size_t me = running_;
    Warp& warp = warps_[me / warp_size];
    const int lane = threads_[running_].state.lane;
    if ((mask >> lane & 1U) == 0) fail("a lane calls a warp operation with a mask that leaves it out");
    if (warp.arrived != 0 && warp.mask != mask) fail("lanes of a warp meet with different masks");
    warp.mask = mask;
    std::memcpy(warp.incoming.lane[lane], value, bytes);
    warp.arrived |= 1U << lane;
    moved_ = true;
    const int generation = warp.generation;
    if (warp.arrived == mask) {
      const size_t first = running_ / warp_size * warp_size;
      for (size_t k = 0; k < warp_size; ++k) {
        if ((mask >> k & 1U) != 0) threads_[first + k].received = warp.incoming;
      }
      warp.arrived = 0;
      ++warp.generation;
    }
    while (warp.generation == generation) yield();
    return threads_[me].received;
  }

 private:
  void release_barrier() {
    moved_ = true;
    if (barrier_arrived_ == 0 || barrier_arrived_ < alive_) return;
    barrier_result_ = barrier_count_;
    barrier_arrived_ = barrier_count_ = 0;
    ++barrier_generation_;
  }
  void yield() { scheduler_ = std::move(scheduler_).resume(); }
  void start(size_t i) {
    threads_[i].fiber = context::fiber(std::allocator_arg, PooledStack(), [this, i](context::fiber&& from) {
      scheduler_ = std::move(from);
      body_();
      threads_[i].ended = true;
      --alive_;
      release_barrier();
      return std::move(scheduler_);
    });
  }
  uint64_t random() {
    shuffle_ = shuffle_ * 6364136223846793005U + 1442695040888963407U;
    return shuffle_ >> 33;
  }

  const char* kernel_;
  const std::function<void()>& body_;
  uint64_t& shuffle_;
  std::vector<Thread> threads_;
  std::vector<Warp> warps_;
  context::fiber scheduler_;
  size_t running_ = 0;
  int alive_ = 0;
  int barrier_arrived_ = 0, barrier_count_ = 0, barrier_result_ = 0, barrier_generation_ = 0;
  bool moved_ = false;
};

Block* running_block = nullptr;

void Block::run() {
  alive_ = static_cast<int>(threads_.size());
  running_block = this;
  for (size_t i = 0; i < threads_.size(); ++i) start(i);
  std::vector<size_t> order(threads_.size());
  std::iota(order.begin(), order.end(), size_t{0});
  while (alive_ > 0) {
    for (size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[random() % (i + 1)]);
    moved_ = false;
    for (const size_t i : order) {
      if (threads_[i].ended) continue;
      running_ = i;
      threads_[i].fiber = std::move(threads_[i].fiber).resume();
    }
    if (!moved_) fail("threads wait for others that never come");
  }
  running_block = nullptr;
}

}  // namespace

const ThreadState& current() { return running_block->current(); }

void run_grid(const char* kernel, Size3 grid, Size3 block, const std::function<void()>& thread) {
  static uint64_t shuffle = 1;
  for (unsigned z = 0; z < grid.z; ++z) {
    for (unsigned y = 0; y < grid.y; ++y) {
      for (unsigned x = 0; x < grid.x; ++x) Block(kernel, grid, block, {x, y, z}, thread, shuffle).run();
    }
  }
}

void block_barrier() { running_block->barrier(false); }
bool block_any(bool predicate) { return running_block->barrier(predicate) > 0; }
int block_count(bool predicate) { return running_block->barrier(predicate); }
void warp_barrier(unsigned mask) {
  const char nothing = 0;
  running_block->exchange(mask, &nothing, 1);
}
WarpValues warp_exchange(unsigned mask, const void* value, size_t bytes) {
  return running_block->exchange(mask, value, bytes);
}

}  // namespace traceflow::emulation

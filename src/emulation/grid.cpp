#include "emulation/grid.h"

#include <algorithm>
#include <array>
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

uint64_t next_random(uint64_t& state) {
  state = state * 6364136223846793005U + 1442695040888963407U;
  return state >> 33;
}

namespace context = boost::context;

// Stacks of fibers that have ended, for those to come.
class StackPool {
 public:
  StackPool() = default;
  ~StackPool() {
    for (context::stack_context& stack : free_) stacks_.deallocate(stack);
  }
  StackPool(const StackPool&) = delete;
  StackPool& operator=(const StackPool&) = delete;

  context::stack_context allocate() {
    if (free_.empty()) return stacks_.allocate();
    const context::stack_context stack = free_.back();
    free_.pop_back();
    return stack;
  }
  void deallocate(context::stack_context& stack) { free_.push_back(stack); }

 private:
  static constexpr size_t stack_bytes = size_t{128} << 10;
  context::fixedsize_stack stacks_{stack_bytes};
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

// The values of one exchange, until the last lane has seen them.
struct Exchange {
  WarpValues values{};
  int readers = 0;
};

struct Warp {
  Exchange* incoming = nullptr;
  unsigned mask = 0;     // of the exchange under way
  unsigned arrived = 0;  // lanes that have come
};

struct Thread {
  ThreadState state;
  context::fiber fiber;
  Exchange* seen = nullptr;  // of the last exchange
  bool waits_for_warp = false, waits_for_block = false, ended = false;
};

// Blocks come one after the other; what they need is kept.
struct Memory {
  std::vector<Thread> threads;
  std::vector<Warp> warps;
  std::vector<std::unique_ptr<Exchange>> exchanges;
  std::vector<Exchange*> free_exchanges;
  std::vector<size_t> warp_order;
};

Memory& memory() {
  static Memory kept;
  return kept;
}

class Block {
 public:
  Block(const char* kernel, Size3 grid, Size3 size, Index3 index, const std::function<void()>& body,
        uint64_t& shuffle)
      : kernel_(kernel), body_(body), shuffle_(shuffle), threads_(memory().threads), warps_(memory().warps) {
    threads_.clear();
    threads_.resize(size_t{size.x} * size.y * size.z);
    warps_.assign((threads_.size() + warp_size - 1) / warp_size, Warp{});
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
    Thread& me = threads_[running_];
    me.waits_for_block = true;
    ++barrier_arrived_;
    if (predicate) ++barrier_count_;
    release_barrier();
    while (me.waits_for_block) yield();
    return barrier_result_;
  }

  // Waits until all lanes of the mask have come. The values stand until the lane's next exchange.
  const WarpValues& exchange(unsigned mask, const void* value, size_t bytes) {
    const size_t mine = running_;
    Thread& me = threads_[mine];
    Warp& warp = warps_[mine / warp_size];
    if ((mask >> me.state.lane & 1U) == 0)
      fail("a lane calls a warp operation with a mask that leaves it out");
    if (warp.arrived != 0 && warp.mask != mask) fail("lanes of a warp meet with different masks");
    leave(me);
    if (warp.arrived == 0) warp.incoming = take_exchange();
    warp.mask = mask;
    std::memcpy(warp.incoming->values.lane[me.state.lane], value, bytes);
    warp.arrived |= 1U << me.state.lane;
    me.waits_for_warp = true;
    moved_ = true;
    if (warp.arrived == mask) release_warp(warp, mine / warp_size * warp_size);
    while (me.waits_for_warp) yield();
    return me.seen->values;
  }

 private:
  void run_warp(size_t warp);
  bool can_run(const Thread& thread) const {
    return !thread.ended && !thread.waits_for_warp && !thread.waits_for_block;
  }

  static Exchange* take_exchange() {
    Memory& kept = memory();
    if (kept.free_exchanges.empty()) {
      kept.exchanges.push_back(std::make_unique<Exchange>());
      return kept.exchanges.back().get();
    }
    Exchange* const exchange = kept.free_exchanges.back();
    kept.free_exchanges.pop_back();
    return exchange;
  }
  static void leave(Thread& thread) {
    if (thread.seen != nullptr && --thread.seen->readers == 0) memory().free_exchanges.push_back(thread.seen);
    thread.seen = nullptr;
  }
  void release_warp(Warp& warp, size_t first) {
    for (size_t k = 0; k < warp_size; ++k) {
      if ((warp.mask >> k & 1U) == 0) continue;
      Thread& thread = threads_[first + k];
      thread.seen = warp.incoming;
      thread.waits_for_warp = false;
      ++warp.incoming->readers;
    }
    warp.arrived = 0;
  }
  void release_barrier() {
    moved_ = true;
    if (barrier_arrived_ == 0 || barrier_arrived_ < alive_) return;
    barrier_result_ = barrier_count_;
    barrier_arrived_ = barrier_count_ = 0;
    for (Thread& thread : threads_) thread.waits_for_block = false;
  }
  void yield() { scheduler_ = std::move(scheduler_).resume(); }
  void start(size_t i) {
    threads_[i].fiber = context::fiber(std::allocator_arg, PooledStack(), [this, i](context::fiber&& from) {
      scheduler_ = std::move(from);
      body_();
      leave(threads_[i]);
      threads_[i].ended = true;
      --alive_;
      release_barrier();
      return std::move(scheduler_);
    });
  }
  uint64_t random() { return next_random(shuffle_); }

  const char* kernel_;
  const std::function<void()>& body_;
  uint64_t& shuffle_;
  std::vector<Thread>& threads_;
  std::vector<Warp>& warps_;
  context::fiber scheduler_;
  size_t running_ = 0;
  int alive_ = 0;
  int barrier_arrived_ = 0, barrier_count_ = 0, barrier_result_ = 0;
  bool moved_ = false;
};

Block* running_block = nullptr;

// Runs the lanes of a warp, in a new order each round, until all of them wait for others or have ended.
void Block::run_warp(size_t warp) {
  const size_t first = warp * warp_size, count = std::min<size_t>(warp_size, threads_.size() - first);
  std::array<uint8_t, warp_size> order{};
  std::iota(order.begin(), order.end(), uint8_t{0});
  for (bool ran = true; ran;) {
    ran = false;
    for (size_t i = count - 1; i > 0; --i) std::swap(order[i], order[random() % (i + 1)]);
    for (size_t k = 0; k < count; ++k) {
      Thread& thread = threads_[first + order[k]];
      if (!can_run(thread)) continue;
      running_ = first + order[k];
      if (!thread.fiber) start(running_);
      thread.fiber = std::move(thread.fiber).resume();
      ran = true;
    }
  }
}

void Block::run() {
  alive_ = static_cast<int>(threads_.size());
  running_block = this;
  std::vector<size_t>& order = memory().warp_order;
  order.resize(warps_.size());
  std::iota(order.begin(), order.end(), size_t{0});
  while (alive_ > 0) {
    for (size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[random() % (i + 1)]);
    moved_ = false;
    for (const size_t warp : order) run_warp(warp);
    if (!moved_) fail("threads wait for others that never come");
  }
  running_block = nullptr;
}

}  // namespace

const ThreadState& current() { return running_block->current(); }

void run_grid(const char* kernel, Size3 grid, Size3 block, const std::function<void()>& thread) {
  static uint64_t shuffle = 1;
  const uint64_t blocks = uint64_t{grid.x} * grid.y * grid.z;
  // Steps that have no divisor in common with the number of blocks come to each of them once.
  uint64_t step = next_random(shuffle) % std::max<uint64_t>(blocks, 1);
  while (std::gcd(step, blocks) != 1 && blocks > 0) ++step;
  uint64_t at = next_random(shuffle);
  for (uint64_t k = 0; k < blocks; ++k) {
    at = (at + step) % blocks;
    const Index3 place{static_cast<unsigned>(at % grid.x), static_cast<unsigned>(at / grid.x % grid.y),
                       static_cast<unsigned>(at / grid.x / grid.y)};
    Block(kernel, grid, block, place, thread, shuffle).run();
  }
}

void block_barrier() { running_block->barrier(false); }
bool block_any(bool predicate) { return running_block->barrier(predicate) > 0; }
int block_count(bool predicate) { return running_block->barrier(predicate); }
void warp_barrier(unsigned mask) {
  const char nothing = 0;
  running_block->exchange(mask, &nothing, 1);
}
const WarpValues& warp_exchange(unsigned mask, const void* value, size_t bytes) {
  return running_block->exchange(mask, value, bytes);
}

}  // namespace traceflow::emulation

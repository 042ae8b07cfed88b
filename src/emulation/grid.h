#pragma once

#include <cstddef>
#include <functional>

// Runs a CUDA grid on the host: blocks one after the other, the threads of a block as fibers that change
// places at barriers and warp-wide operations; blocks, warps and the lanes of each in an order that is
// shuffled each time, so that a barrier that is missing shows, and what depends on the order of blocks. What
// a device leaves undefined ends the program with a message: lanes that disagree about a mask, a barrier that
// some threads wait at while others have no way to reach it.
namespace traceflow::emulation {

inline constexpr int warp_size = 32;
inline constexpr size_t lane_bytes = 16;

struct Index3 {
  unsigned x = 0, y = 0, z = 0;
};
struct Size3 {
  unsigned x = 1, y = 1, z = 1;
};

// The CUDA thread that is running.
struct ThreadState {
  Index3 thread, block;
  Size3 block_size, grid_size;
  int lane = 0;
};
const ThreadState& current();

void run_grid(const char* kernel, Size3 grid, Size3 block, const std::function<void()>& thread);
// The same on a line of blocks, with the device's memory open to it. False, and nothing is run, where
// refuse_launches says so.
bool launch(const char* kernel, unsigned blocks, unsigned threads, const std::function<void()>& thread);

void require_no_host_tensors(const char* kernel, const void* argument, size_t bytes);
// Ends the program where a kernel's argument holds the address of a tensor on the host
// (emulation/host_tensors.cpp): an emulated kernel could read it, one on a device could not.
template <class T>
void require_no_host_tensors(const char* kernel, T argument) {
#if defined(__has_builtin)
#if __has_builtin(__builtin_clear_padding)
  // Between its members lies what was there before: now and then an address.
  __builtin_clear_padding(&argument);
#endif
#endif
  require_no_host_tensors(kernel, &argument, sizeof(argument));
}

void block_barrier();
bool block_any(bool predicate);
int block_count(bool predicate);
void warp_barrier(unsigned mask);

struct WarpValues {
  std::byte lane[warp_size][lane_bytes];
};
// Brings one value a lane of `mask`, and returns those of all when all have come. They stand until the lane's
// next exchange.
const WarpValues& warp_exchange(unsigned mask, const void* value, size_t bytes);

}  // namespace traceflow::emulation

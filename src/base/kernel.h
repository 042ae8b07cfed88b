#pragma once

// What a .cu file needs to launch kernels: CUDA's own when compiled by nvcc. Tests compile the same files
// with the host's compiler and an emulation (src/emulation).
#if defined(__CUDACC__)
#include <cuda_runtime.h>
#else
#include "emulation/cuda.h"
#endif

#include <cstdint>
#include <string>

#include "base/device_memory.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/profile.h"

namespace traceflow::cuda {

inline constexpr unsigned full_warp = 0xffffffffU;
inline constexpr int warp_lanes = 32;

struct Grid {
  int64_t blocks;
  int threads;  // per block
};

// Returns the pool's unused memory to the driver. Waits for all work.
void trim_pool();

// Launches a kernel. start: tries to launch, and returns whether the driver had enough memory, which it needs
// to load a kernel's code or to grow its stacks. As for a tensor, the pool's unused memory is returned before
// the last attempt; then throws OutOfMemory.
template <class Start>
void start_kernel(const Start& start) {
  if (start()) return;
  trim_pool();
  if (!start()) throw memory::OutOfMemory(0, facts().free_bytes);
}

#if defined(__CUDACC__)

// The stream that all work runs on.
cudaStream_t stream();
// Throws OutOfMemory if a call ran out of memory, InternalError for any other error.
void check(cudaError_t result, const char* what);

template <class... Parameters, class... Arguments>
void launch(const char* name, Grid grid, void (*kernel)(Parameters...), const Arguments&... arguments) {
  if (grid.blocks == 0) return;
  const profile::Scope scope(name);
  start_kernel([&] {
    kernel<<<static_cast<unsigned>(grid.blocks), static_cast<unsigned>(grid.threads), 0, stream()>>>(
        static_cast<Parameters>(arguments)...);
    const cudaError_t result = cudaGetLastError();
    if (result != cudaErrorMemoryAllocation) check(result, name);
    return result == cudaSuccess;
  });
  if (profile::is_on()) synchronise();
}

#else

template <class... Parameters, class... Arguments>
void launch(const char* name, Grid grid, void (*kernel)(Parameters...), const Arguments&... arguments) {
  const profile::Scope scope(name);
  (emulation::require_no_host_tensors(name, arguments), ...);
  start_kernel([&] {
    return emulation::launch(name, static_cast<unsigned>(grid.blocks), static_cast<unsigned>(grid.threads),
                             [&] { kernel(static_cast<Parameters>(arguments)...); });
  });
}

#endif

inline int64_t blocks_for(int64_t n, int threads) { return (n + threads - 1) / threads; }

template <class F>
__global__ void index_kernel(int64_t n, F f) {
  const int64_t i = int64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  if (i < n) f(i);
}

template <class F>
void for_each_index(const char* description, int64_t n, const F& f) {
  constexpr int threads = 256;
  launch(description, {blocks_for(n, threads), threads}, index_kernel<F>, n, f);
}

// The sum over the lanes of a warp, returned to all of them; in a fixed order.
template <class T>
__device__ T warp_sum(T value) {
  for (int by = warp_lanes / 2; by > 0; by /= 2) value += __shfl_xor_sync(full_warp, value, by);
  return value;
}

}  // namespace traceflow::cuda

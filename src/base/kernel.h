#pragma once

// What a .cu file needs to start kernels. Compiled by nvcc these are CUDA's; the tests compile the same files
// with the host's compiler, where an emulation stands in (tests/emulation).
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
  int threads;  // a block
};

// Gives the driver back what the pool holds and no tensor stands in. Waits for all work.
void trim_pool();

// Starts a kernel. start: tries to, and says whether the driver had memory for it, which it takes when it
// loads a kernel's code or makes room for its stacks. As for a tensor, what the pool holds goes back before
// the last try; then throws OutOfMemory.
template <class Start>
void start_kernel(const Start& start) {
  if (start()) return;
  trim_pool();
  if (!start()) throw memory::OutOfMemory(0, facts().free_bytes);
}

#if defined(__CUDACC__)

// The stream that all work is put on.
cudaStream_t stream();
// Throws OutOfMemory where a call found no memory, InternalError where it was refused otherwise.
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

// The sum over the lanes of a warp, in all of them; in a fixed order.
template <class T>
__device__ T warp_sum(T value) {
  for (int by = warp_lanes / 2; by > 0; by /= 2) value += __shfl_xor_sync(full_warp, value, by);
  return value;
}

}  // namespace traceflow::cuda

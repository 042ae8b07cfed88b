#pragma once

#include <bit>
#include <cstdint>

#include "base/kernel.h"

// Load balancing for one surfel per lane: most are small, but some cover most of the image. The lanes of the
// warp share the large ones.
namespace traceflow::raster::cuda_stage {

// Calls f(thread) for n threads and for those that fill the last block, so that every warp is complete.
template <class F>
__global__ void whole_warps_kernel(F f) {
  f(int64_t{blockIdx.x} * blockDim.x + threadIdx.x);
}

template <class F>
void for_each_in_whole_warps(const char* description, int64_t n, const F& f) {
  constexpr int threads = 8 * cuda::warp_lanes;
  cuda::launch(description, {cuda::blocks_for(n, threads), threads}, whole_warps_kernel<F>, f);
}

__device__ inline int lane_of_thread() { return static_cast<int>(threadIdx.x) % cuda::warp_lanes; }

// The value of another lane.
template <class T>
__device__ T from_lane(int lane, const T& mine) {
  struct Words {
    unsigned word[sizeof(T) / sizeof(unsigned)];
  };
  static_assert(sizeof(T) == sizeof(Words));
  auto words = std::bit_cast<Words>(mine);
#pragma unroll
  for (unsigned& word : words.word) word = __shfl_sync(cuda::full_warp, word, lane);
  return std::bit_cast<T>(words);
}

// Calls f(owner, theirs) in all lanes together, for each lane with is_shared in turn. All lanes of the warp
// take part.
template <class T, class F>
__device__ void for_each_shared(bool is_shared, const T& mine, const F& f) {
  for (unsigned left = __ballot_sync(cuda::full_warp, is_shared); left != 0; left &= left - 1) {
    const int owner = __ffs(static_cast<int>(left)) - 1;
    f(owner, from_lane(owner, mine));
  }
}

}  // namespace traceflow::raster::cuda_stage

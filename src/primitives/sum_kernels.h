#pragma once

#include <algorithm>
#include <cstdint>

#include "base/kernel.h"
#include "base/tensor.h"
#include "primitives/sums.h"

// Sums on the CUDA device, in an order that depends only on the number of terms: each block sums its share,
// then one block sums the results.
namespace traceflow::cuda {

inline constexpr unsigned sum_threads = 256;

// The sum over the sum_threads threads of a block, returned to all of them.
template <class T>
__device__ T block_sum(const T& mine) {
  alignas(T) __shared__ unsigned char memory[sum_threads * sizeof(T)];
  T* const sums = reinterpret_cast<T*>(memory);
  __syncthreads();  // the previous sum may still be in use
  sums[threadIdx.x] = mine;
  __syncthreads();
  for (unsigned half = sum_threads / 2; half > 0; half /= 2) {
    if (threadIdx.x < half) sums[threadIdx.x] += sums[threadIdx.x + half];
    __syncthreads();
  }
  return sums[0];
}

template <class T, class F>
__global__ void __launch_bounds__(sum_threads) partial_sums(int64_t n, F f, T* partial) {
  T sum{};
  const int64_t stride = int64_t{gridDim.x} * sum_threads;
  for (int64_t i = int64_t{blockIdx.x} * sum_threads + threadIdx.x; i < n; i += stride) sum += f(i);
  sum = block_sum(sum);
  if (threadIdx.x == 0) partial[blockIdx.x] = sum;
}

template <class T, class G>
__global__ void __launch_bounds__(sum_threads) add_up(int64_t n, const T* partial, G finish) {
  T sum{};
  for (int64_t i = threadIdx.x; i < n; i += sum_threads) sum += partial[i];
  sum = block_sum(sum);
  if (threadIdx.x == 0) finish(sum);
}

// Memory for `count` partial sums, valid until the next call. All work is on one stream, so the next sum may
// reuse it at once.
template <class T>
T* memory_for_partial_sums(int64_t count) {
  static thread_local Tensor<T> kept;
  kept.place(Device::cuda).resize({count});
  return kept.data();
}

template <class T, class F, class G>
void sum_each_index(const char* description, int64_t n, const F& f, const G& finish) {
  constexpr int64_t most_blocks = 1024, terms_each = 4;
  const int64_t blocks = std::clamp<int64_t>(blocks_for(n, sum_threads * terms_each), 1, most_blocks);
  T* const partial = memory_for_partial_sums<T>(blocks);
  launch(description, {blocks, sum_threads}, partial_sums<T, F>, n, f, partial);
  launch(description, {1, sum_threads}, add_up<T, G>, blocks, partial, finish);
}

}  // namespace traceflow::cuda

#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "emulation/grid.h"

// CUDA's kernel language for the host's compiler, as far as the project's kernels speak it. A .cu file that
// is compiled with this header in the place of cuda_runtime.h runs on fibers, one for each CUDA thread
// (emulation/grid.h).
#define __global__
#define __device__
#define __host__
#define __forceinline__ inline
#define __launch_bounds__(...)
#define __grid_constant__
// Blocks run one after the other, so one copy serves them all; as on a device it holds what the last one
// left.
#define __shared__ static

#define threadIdx (::traceflow::emulation::current().thread)
#define blockIdx (::traceflow::emulation::current().block)
#define blockDim (::traceflow::emulation::current().block_size)
#define gridDim (::traceflow::emulation::current().grid_size)

struct alignas(16) float4 {
  float x, y, z, w;
};

inline void __syncthreads() { traceflow::emulation::block_barrier(); }
inline int __syncthreads_or(int predicate) { return traceflow::emulation::block_any(predicate != 0) ? 1 : 0; }
inline int __syncthreads_and(int predicate) {
  return traceflow::emulation::block_any(predicate == 0) ? 0 : 1;
}
inline int __syncthreads_count(int predicate) { return traceflow::emulation::block_count(predicate != 0); }
inline void __syncwarp(unsigned mask = 0xffffffffU) { traceflow::emulation::warp_barrier(mask); }
inline void __threadfence() {}

namespace traceflow::emulation {

// What every lane of `mask` brought, seen by each.
template <class T>
struct Lanes {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= lane_bytes);
  Lanes(unsigned mask, T mine) : values(warp_exchange(mask, &mine, sizeof(T))) {}
  T operator[](int lane) const {
    T value;
    std::memcpy(&value, values.lane[lane], sizeof(T));
    return value;
  }
  const WarpValues& values;
};

inline int lane() { return current().lane; }

}  // namespace traceflow::emulation

template <class T>
T __shfl_sync(unsigned mask, T value, int from, int width = 32) {
  const traceflow::emulation::Lanes<T> all(mask, value);
  const int base = traceflow::emulation::lane() / width * width;
  return all[base + (from & (width - 1))];
}
template <class T>
T __shfl_xor_sync(unsigned mask, T value, int with, int width = 32) {
  const traceflow::emulation::Lanes<T> all(mask, value);
  const int lane = traceflow::emulation::lane();
  const int other = lane ^ with;
  return other / width == lane / width ? all[other] : value;
}
template <class T>
T __shfl_up_sync(unsigned mask, T value, unsigned by, int width = 32) {
  const traceflow::emulation::Lanes<T> all(mask, value);
  const int lane = traceflow::emulation::lane();
  const int other = lane - static_cast<int>(by);
  return other >= lane / width * width ? all[other] : value;
}
template <class T>
T __shfl_down_sync(unsigned mask, T value, unsigned by, int width = 32) {
  const traceflow::emulation::Lanes<T> all(mask, value);
  const int lane = traceflow::emulation::lane();
  const int other = lane + static_cast<int>(by);
  return other < (lane / width + 1) * width ? all[other] : value;
}
inline unsigned __ballot_sync(unsigned mask, int predicate) {
  const traceflow::emulation::Lanes<int> all(mask, predicate);
  unsigned bits = 0;
  for (int lane = 0; lane < 32; ++lane) {
    if ((mask >> lane & 1U) != 0 && all[lane] != 0) bits |= 1U << lane;
  }
  return bits;
}
inline int __any_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) != 0 ? 1 : 0; }
inline int __all_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) == mask ? 1 : 0; }
inline unsigned __match_any_sync(unsigned mask, unsigned value) {
  const traceflow::emulation::Lanes<unsigned> all(mask, value);
  unsigned bits = 0;
  for (int lane = 0; lane < 32; ++lane) {
    if ((mask >> lane & 1U) != 0 && all[lane] == value) bits |= 1U << lane;
  }
  return bits;
}

// Fibers change places at barriers only, so that a plain update is atomic.
template <class T>
T atomicAdd(T* address, std::type_identity_t<T> value) {
  const T old = *address;
  *address = old + value;
  return old;
}
template <class T>
T atomicMax(T* address, std::type_identity_t<T> value) {
  const T old = *address;
  if (value > old) *address = value;
  return old;
}
template <class T>
T atomicMin(T* address, std::type_identity_t<T> value) {
  const T old = *address;
  if (value < old) *address = value;
  return old;
}
template <class T>
T atomicOr(T* address, std::type_identity_t<T> value) {
  const T old = *address;
  *address = old | value;
  return old;
}
template <class T>
T atomicExch(T* address, std::type_identity_t<T> value) {
  const T old = *address;
  *address = value;
  return old;
}
template <class T>
T atomicCAS(T* address, std::type_identity_t<T> expected, std::type_identity_t<T> desired) {
  const T old = *address;
  if (old == expected) *address = desired;
  return old;
}

template <class T>
T __ldg(const T* address) {
  return *address;
}
// Past the first cache, of which the emulation has none.
template <class T>
T __ldcg(const T* address) {
  return *address;
}
inline int __popc(unsigned x) { return std::popcount(x); }
inline int __clz(int x) { return std::countl_zero(static_cast<unsigned>(x)); }
inline int __clzll(long long x) { return std::countl_zero(static_cast<unsigned long long>(x)); }
inline int __ffs(int x) { return x == 0 ? 0 : std::countr_zero(static_cast<unsigned>(x)) + 1; }
inline unsigned __float_as_uint(float x) { return std::bit_cast<unsigned>(x); }
inline float __uint_as_float(unsigned x) { return std::bit_cast<float>(x); }
inline int __float_as_int(float x) { return std::bit_cast<int>(x); }
inline float __int_as_float(int x) { return std::bit_cast<float>(x); }
inline float rsqrtf(float x) { return 1.0F / std::sqrt(x); }
inline float __frcp_rn(float x) { return 1.0F / x; }
inline float __fdividef(float x, float y) { return x / y; }

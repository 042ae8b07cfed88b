#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "base/kernel.h"
#include "primitives/sort.h"

namespace traceflow::cuda {

namespace {

template <class Key>
void sort(int64_t n, int bits, const Key* keys, Key* sorted_keys, const uint32_t* values,
          uint32_t* sorted_values, Tensor<uint8_t>& scratch) {
  if (n == 0) return;
  size_t bytes = 0;
  check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, sorted_keys, values, sorted_values, n, 0, bits,
                                        stream()),
        "a sort's scratch memory");
  scratch.place(Device::cuda).resize({static_cast<int64_t>(bytes)});
  const profile::Scope scope("sort");
  check(cub::DeviceRadixSort::SortPairs(scratch.data(), bytes, keys, sorted_keys, values, sorted_values, n, 0,
                                        bits, stream()),
        "a sort");
  if (profile::is_on()) synchronise();
}

template <class T>
void sum(const T* in, T* out, int64_t n, Tensor<uint8_t>& scratch) {
  if (n == 0) return;
  size_t bytes = 0;
  check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, in, out, n, stream()), "the memory of a running sum");
  scratch.place(Device::cuda).resize({static_cast<int64_t>(bytes)});
  const profile::Scope scope("running sum");
  check(cub::DeviceScan::ExclusiveSum(scratch.data(), bytes, in, out, n, stream()), "a running sum");
  if (profile::is_on()) synchronise();
}

}  // namespace

void sort_pairs(int64_t n, int bits, const uint64_t* keys, uint64_t* sorted_keys, const uint32_t* values,
                uint32_t* sorted_values, Tensor<uint8_t>& scratch) {
  sort(n, bits, keys, sorted_keys, values, sorted_values, scratch);
}

void sort_pairs(int64_t n, int bits, const uint32_t* keys, uint32_t* sorted_keys, const uint32_t* values,
                uint32_t* sorted_values, Tensor<uint8_t>& scratch) {
  sort(n, bits, keys, sorted_keys, values, sorted_values, scratch);
}

void exclusive_sum(const int32_t* in, int32_t* out, int64_t n, Tensor<uint8_t>& scratch) {
  sum(in, out, n, scratch);
}

void exclusive_sum(const int64_t* in, int64_t* out, int64_t n, Tensor<uint8_t>& scratch) {
  sum(in, out, n, scratch);
}

}  // namespace traceflow::cuda

#include "primitives/sort.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "base/profile.h"
#include "emulation/device.h"

namespace traceflow::cuda {

namespace {

template <class Key>
void sort(int64_t n, int bits, const Key* keys, Key* sorted_keys, const uint32_t* values,
          uint32_t* sorted_values) {
  require(n == 0 || (keys != sorted_keys && values != sorted_values), "a sort has room for its results");
  const profile::Scope scope("sort");
  const emulation::DeviceAccess access;
  const Key mask = bits >= static_cast<int>(8 * sizeof(Key)) ? ~Key{0} : (Key{1} << bits) - 1;
  std::vector<int64_t> order(static_cast<size_t>(n));
  std::iota(order.begin(), order.end(), int64_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](int64_t a, int64_t b) { return (keys[a] & mask) < (keys[b] & mask); });
  for (const int64_t from : order) {
    *sorted_keys++ = keys[from];
    *sorted_values++ = values[from];
  }
}

template <class T>
void sum(const T* in, T* out, int64_t n, Tensor<uint8_t>& scratch) {
  scratch.place(Device::cuda).resize({1});
  const profile::Scope scope("running sum");
  const emulation::DeviceAccess access;
  T so_far = 0;
  for (int64_t i = 0; i < n; ++i) {
    const T value = in[i];
    out[i] = so_far;
    so_far += value;
  }
}

}  // namespace

void sort_pairs(int64_t n, int bits, const uint64_t* keys, uint64_t* sorted_keys, const uint32_t* values,
                uint32_t* sorted_values, Tensor<uint8_t>&) {
  sort(n, bits, keys, sorted_keys, values, sorted_values);
}

void sort_pairs(int64_t n, int bits, const uint32_t* keys, uint32_t* sorted_keys, const uint32_t* values,
                uint32_t* sorted_values, Tensor<uint8_t>&) {
  sort(n, bits, keys, sorted_keys, values, sorted_values);
}

void exclusive_sum(const int32_t* in, int32_t* out, int64_t n, Tensor<uint8_t>& scratch) {
  sum(in, out, n, scratch);
}

void exclusive_sum(const int64_t* in, int64_t* out, int64_t n, Tensor<uint8_t>& scratch) {
  sum(in, out, n, scratch);
}

}  // namespace traceflow::cuda

#include "base/sort.h"

#include <cub/device/device_scan.cuh>

#include "base/kernel.h"

namespace traceflow::cuda {

void exclusive_sum(const int32_t* in, int32_t* out, int64_t n, Tensor<uint8_t>& scratch) {
  if (n == 0) return;
  size_t bytes = 0;
  check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, in, out, n, stream()), "the memory of a running sum");
  scratch.place(Device::cuda).resize({static_cast<int64_t>(bytes)});
  check(cub::DeviceScan::ExclusiveSum(scratch.data(), bytes, in, out, n, stream()), "a running sum");
}

}  // namespace traceflow::cuda

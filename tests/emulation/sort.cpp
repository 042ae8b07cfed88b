#include "base/sort.h"

#include "emulation/device.h"

// Stands in for base/sort_cuda.cu.
namespace traceflow::cuda {

void exclusive_sum(const int32_t* in, int32_t* out, int64_t n, Tensor<uint8_t>& scratch) {
  scratch.place(Device::cuda).resize({1});
  const emulation::DeviceAccess access;
  int32_t sum = 0;
  for (int64_t i = 0; i < n; ++i) {
    const int32_t value = in[i];
    out[i] = sum;
    sum += value;
  }
}

}  // namespace traceflow::cuda

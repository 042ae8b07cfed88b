#pragma once

#include <cstdint>

#include "base/tensor.h"

// Orders and running sums of lists on the CUDA device. `scratch` is memory that a call may use; kept by the
// caller, so that calls of the same size do not allocate.
namespace traceflow::cuda {

// out[i] = in[0] + … + in[i − 1], so that with one entry more than there is to count the last is the total.
// Both have n entries on the device; they may be the same list.
TRACEFLOW_WITH_CUDA void exclusive_sum(const int32_t* in, int32_t* out, int64_t n, Tensor<uint8_t>& scratch);

}  // namespace traceflow::cuda

#pragma once

#include <cstdint>

#include "base/tensor.h"

// Sorting and prefix sums of lists on the CUDA device. `scratch` is working memory that the caller keeps, so
// that calls of the same size do not allocate.
namespace traceflow::cuda {

// Sorts n values by the lowest `bits` bits of their keys, ascending; equal keys keep their order. All
// addresses are on the device, and results do not overlap the input.
TRACEFLOW_WITH_CUDA void sort_pairs(int64_t n, int bits, const uint64_t* keys, uint64_t* sorted_keys,
                                    const uint32_t* values, uint32_t* sorted_values,
                                    Tensor<uint8_t>& scratch);
TRACEFLOW_WITH_CUDA void sort_pairs(int64_t n, int bits, const uint32_t* keys, uint32_t* sorted_keys,
                                    const uint32_t* values, uint32_t* sorted_values,
                                    Tensor<uint8_t>& scratch);

// out[i] = in[0] + … + in[i − 1]: with one more entry than there is to count, the last is the total. Both
// have n entries on the device; they may be the same list.
TRACEFLOW_WITH_CUDA void exclusive_sum(const int32_t* in, int32_t* out, int64_t n, Tensor<uint8_t>& scratch);
TRACEFLOW_WITH_CUDA void exclusive_sum(const int64_t* in, int64_t* out, int64_t n, Tensor<uint8_t>& scratch);

}  // namespace traceflow::cuda

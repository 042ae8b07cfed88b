#pragma once

#include <cstdint>

#include "base/tensor.h"

// Sorting on the CUDA device.
namespace traceflow::cuda {

// Puts n values in ascending order of the lowest `bits` bits of their keys; equal keys keep their order. All
// addresses are on the device, and those of the results differ from those of the input. `scratch` keeps its
// memory for the next call.
TRACEFLOW_WITH_CUDA void sort_pairs(int64_t n, int bits, const uint64_t* keys, uint64_t* sorted_keys,
                                    const uint32_t* values, uint32_t* sorted_values,
                                    Tensor<uint8_t>& scratch);
TRACEFLOW_WITH_CUDA void sort_pairs(int64_t n, int bits, const uint32_t* keys, uint32_t* sorted_keys,
                                    const uint32_t* values, uint32_t* sorted_values,
                                    Tensor<uint8_t>& scratch);

}  // namespace traceflow::cuda

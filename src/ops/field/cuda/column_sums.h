#pragma once

#include <cstdint>

#include "base/device.h"
#include "math/bf16.h"

// The field's kernels that are not element-wise.
namespace traceflow::field::cuda {

// Adds column sums per slot: slot s sums the rows from s·rows/slots on, in a fixed order, into
// sums[s·sums_stride + column]. values: dense rows of `columns` numbers, a multiple of 16 up to 1024.
TRACEFLOW_WITH_CUDA void add_column_sums(const float* values, int64_t rows, int columns, int slots,
                                         float* sums, int64_t sums_stride);
TRACEFLOW_WITH_CUDA void add_column_sums(const Bf16* values, int64_t rows, int columns, int slots,
                                         float* sums, int64_t sums_stride);

}  // namespace traceflow::field::cuda

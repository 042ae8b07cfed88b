#pragma once

#include <cmath>
#include <cstdint>

#include "base/device.h"
#include "ops/field/field.h"
#include "ops/field/gemm.h"

// The element-wise steps between the network's matrix products, with SIMD. Matrices are dense and row-major;
// their number of columns is a multiple of 16.
namespace traceflow::field {

// Whether the network is evaluated at a point: every coordinate is finite and within coordinate_limit.
TRACEFLOW_HD inline bool evaluated(const float* point) {
  for (int c = 0; c < 3; ++c) {
    if (!(std::abs(point[c]) <= coordinate_limit)) return false;
  }
  return true;
}

// Writes γ(point) of `count` points into rows of `columns` numbers, zero-padded on the right. Rows up to
// `rows`, and points that are not evaluated, enter as the origin.
void encode_points(const float* points, int64_t count, int64_t rows, int octaves, int64_t columns,
                   float* encoding);

// Rounds to the nearest bf16, ties to even.
void round_to_bf16(const float* from, int64_t count, uint16_t* to);

// Backward of ReLU, in place: gradient = 0 unless the activation is > 0. Adds the column sums to column_sum.
// With bf16 activations the rounded result is also written to `rounded`.
void mask_by_activation(const void* activation, DType number, int64_t rows, int64_t columns, float* gradient,
                        uint16_t* rounded, float* column_sum);

// to[i] += Σ_k from[k·stride + i] for i < count, each sum in the order of k.
void add_slots(const float* from, int64_t slots, int64_t stride, int64_t count, float* to);

}  // namespace traceflow::field

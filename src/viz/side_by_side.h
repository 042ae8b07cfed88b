#pragma once

#include "base/tensor.h"

namespace traceflow::viz {

// Joins two pictures (H×W×3) of equal height, left and right. Throws InputError if the heights differ.
Tensor<uint8_t> side_by_side(const Tensor<uint8_t>& left, const Tensor<uint8_t>& right);

}  // namespace traceflow::viz

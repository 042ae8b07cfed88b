#pragma once

#include "base/tensor.h"

namespace traceflow::viz {

// Two pictures (H×W×3) of one height in one, left and right. Throws InputError where the heights differ.
Tensor<uint8_t> side_by_side(const Tensor<uint8_t>& left, const Tensor<uint8_t>& right);

}  // namespace traceflow::viz

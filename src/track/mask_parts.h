#pragma once

#include <vector>

#include "base/tensor.h"

namespace traceflow {

// The connected parts (8 neighbours) of a mask (H×W): the pixel indices of each part, in the order of their
// first pixels.
std::vector<std::vector<int64_t>> mask_parts(const Tensor<uint8_t>& mask);

}  // namespace traceflow

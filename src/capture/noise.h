#pragma once

#include <optional>

#include "base/tensor.h"

namespace traceflow {

// Standard deviation of a picture's noise, in 8-bit levels, from the median of the finest diagonal Haar
// coefficients (Donoho and Johnstone 1994): they hold noise and, in few places, edges. Texture as fine as
// pixels counts as noise. Blocks of 2×2 with a value of 0 or 255 are left out, where noise is cut off.
// picture: H×W×C; mask: H×W, only blocks that lie in it wholly count; empty: all. None of fewer than 100
// values.
std::optional<double> noise_deviation(const Tensor<uint8_t>& picture, const Tensor<uint8_t>& mask);

}  // namespace traceflow

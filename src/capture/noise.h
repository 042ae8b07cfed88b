#pragma once

#include <optional>

#include "base/tensor.h"

namespace traceflow {

// Standard deviation of an image's noise, in 8-bit levels, from the median of the finest diagonal Haar
// coefficients (Donoho and Johnstone 1994). These contain noise and only few edges. Texture of pixel size
// counts as noise. Blocks of 2×2 pixels that contain 0 or 255 are excluded, since noise is clipped there.
// picture: H×W×C. mask: H×W; only blocks that lie fully in it count; empty: all count. Returns nothing for
// fewer than 100 values.
std::optional<double> noise_deviation(const Tensor<uint8_t>& picture, const Tensor<uint8_t>& mask);

}  // namespace traceflow

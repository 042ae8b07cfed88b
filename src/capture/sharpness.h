#pragma once

#include "base/tensor.h"

namespace traceflow {

// A picture's luminance, H×W×1, by the weights of BT.601; what has fewer than three channels as it is.
Tensor<uint8_t> grey_of(const Tensor<uint8_t>& picture);

// How sharp a picture is, against others of the same scene and size: the variance of its Laplacian, in
// squares of 8-bit levels. H×W or H×W×1; 0 for pictures below 3 pixels a side.
double sharpness(const Tensor<uint8_t>& grey);

}  // namespace traceflow

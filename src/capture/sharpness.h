#pragma once

#include "base/tensor.h"

namespace traceflow {

// An image's luminance, H×W×1, with the weights of BT.601. Images with fewer than three channels are returned
// unchanged.
Tensor<uint8_t> grey_of(const Tensor<uint8_t>& picture);

// Sharpness for comparing images of one scene and size: the variance of the Laplacian, in squared 8-bit
// levels. Input is H×W or H×W×1; 0 for images below 3 pixels a side.
double sharpness(const Tensor<uint8_t>& grey);

}  // namespace traceflow

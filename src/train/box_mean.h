#pragma once

#include "base/tensor.h"

namespace traceflow {

// The mean of an image (H×W×C or H×W) over a square around each pixel, `half_window` pixels to each side.
// Parts of the square outside the image are left out.
Tensor<float> box_mean(const Tensor<float>& image, int64_t half_window);

}  // namespace traceflow

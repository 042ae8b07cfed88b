#pragma once

#include "base/tensor.h"

namespace traceflow {

// The mean of an image (H×W×C or H×W) over the square of `half_window` pixels to each side of every pixel, as
// far as it lies in the image.
Tensor<float> box_mean(const Tensor<float>& image, int64_t half_window);

}  // namespace traceflow

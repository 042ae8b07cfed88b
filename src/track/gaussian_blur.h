#pragma once

#include "base/tensor.h"

namespace traceflow {

// Blurs an image H×W×N in place by a Gaussian of so many pixels, the border repeated; none under 0.3. Only
// what is near numbers other than 0 is computed: derivatives are 0 in most of a picture. along: scratch
// memory.
void gaussian_blur(Tensor<float>& image, Tensor<float>& along, int64_t height, int64_t width, int64_t numbers,
                   double sigma);

}  // namespace traceflow

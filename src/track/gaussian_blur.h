#pragma once

#include "base/tensor.h"

namespace traceflow {

// Blurs an image H×W×N in place by a Gaussian of `sigma` pixels, with the border repeated. Does nothing for a
// sigma under 0.3. Computes only near non-zero numbers, because derivatives are 0 in most of an image. along:
// scratch memory.
void gaussian_blur(Tensor<float>& image, Tensor<float>& along, int64_t height, int64_t width, int64_t numbers,
                   double sigma);

}  // namespace traceflow

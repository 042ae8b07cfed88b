#pragma once

#include <cstdint>

#include "base/device.h"

// The network's kernels that are not element-wise.
namespace traceflow::lpips::cuda {

// Two images' last features of a stage: pixels × stride numbers, the first `channels` of which are used.
struct Features {
  const float *a, *b;
  const float* linear;  // channels
  int64_t pixels;
  int channels, stride;
};

// Computes the distance at each pixel and, if grad_a is given, scale · its gradient by a. The gradient is
// zero where a is zero, since the gate of the ReLU that computed a is closed there.
TRACEFLOW_WITH_CUDA void compare(const Features& features, double scale, double* distances, float* grad_a);

}  // namespace traceflow::lpips::cuda

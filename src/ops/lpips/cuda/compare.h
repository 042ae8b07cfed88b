#pragma once

#include <cstdint>

#include "base/device.h"

// The network's kernels that are more than a step for each element.
namespace traceflow::lpips::cuda {

// Two images' last features of a stage: pixels × stride numbers, of which `channels` count.
struct Features {
  const float *a, *b;
  const float* linear;  // channels
  int64_t pixels;
  int channels, stride;
};

// The distance at each pixel, and, where grad_a is given, scale · its gradient by a: zero where a is, since
// the gate of the ReLU that made it is closed there.
TRACEFLOW_WITH_CUDA void compare(const Features& features, double scale, double* distances, float* grad_a);

}  // namespace traceflow::lpips::cuda

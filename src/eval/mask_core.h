#pragma once

#include "base/tensor.h"

// The core of a mask (its rim removed), which separates errors of a surface from errors of its silhouette.
namespace traceflow::eval {

// The rim's width in pixels for an image width: a sixtieth of it, rounded, at least 1.
int64_t rim_of(int64_t image_width);

// The mask (H×W, on the host; nonzero: inside) eroded by a disk: 1 if no pixel centre outside the mask is
// within `radius` pixels of the pixel's centre, else 0. The image border does not erode the mask.
Tensor<uint8_t> eroded(const Tensor<uint8_t>& mask, int64_t radius);

// The mask without its rim.
Tensor<uint8_t> core_of(const Tensor<uint8_t>& mask);

}  // namespace traceflow::eval

#pragma once

#include "base/tensor.h"

// A mask without its rim, which tells errors of a surface from errors of its silhouette.
namespace traceflow::eval {

// The rim's width in pixels for images of a width: a sixtieth of it, rounded, and 1 at least.
int64_t rim_of(int64_t image_width);

// The mask (H×W, on the host; not zero: inside) eroded by a disk: 1 where no pixel outside the mask has its
// centre within `radius` pixels of the pixel's own, else 0. The image's border is no silhouette: what lies
// beyond it takes nothing away.
Tensor<uint8_t> eroded(const Tensor<uint8_t>& mask, int64_t radius);

// The mask without the rim that belongs to its width.
Tensor<uint8_t> core_of(const Tensor<uint8_t>& mask);

}  // namespace traceflow::eval

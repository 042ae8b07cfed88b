#pragma once

#include "render/frame.h"

namespace traceflow::eval {

// The number of a frame's main surfels that are visible in a mask (H×W, on the host; nonzero: inside). Their
// centres project into the mask and are at most 2 % behind the rendered depth there.
int64_t surfels_in_mask(const Frame& frame, const Tensor<uint8_t>& mask);

}  // namespace traceflow::eval

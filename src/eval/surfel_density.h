#pragma once

#include "render/frame.h"

namespace traceflow::eval {

// How many of a frame's main surfels show in a mask (H×W, on the host; not zero: inside): their centres fall
// into it and lie at most 2 % behind the depth that is drawn there.
int64_t surfels_in_mask(const Frame& frame, const Tensor<uint8_t>& mask);

}  // namespace traceflow::eval

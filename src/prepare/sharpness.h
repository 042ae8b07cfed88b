#pragma once

#include "base/tensor.h"

namespace traceflow::prepare {

// How sharp a picture is, against others of the same scene and size: the variance of its Laplacian. H×W or
// H×W×1; 0 for pictures below 3 pixels a side.
double sharpness(const Tensor<uint8_t>& grey);

}  // namespace traceflow::prepare

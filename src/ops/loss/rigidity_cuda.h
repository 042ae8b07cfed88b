#pragma once

#include "base/device.h"
#include "ops/loss/rigidity.h"

namespace traceflow::loss::cuda {

// Like loss::rigidity, for surfels and edges on the device.
TRACEFLOW_WITH_CUDA void rigidity(const Tensor<float>& rest, const Tensor<float>& posed,
                                  const Tensor<int32_t>& subset, const Neighbours& edges, double strain,
                                  double weight, Tensor<float>& grad_rest, Tensor<float>& grad_posed,
                                  Mean* mean);

}  // namespace traceflow::loss::cuda

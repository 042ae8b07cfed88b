#pragma once

#include "base/tensor.h"

// The backward pass on the CUDA device. The contract is that of environment_map.h.
namespace traceflow::environment_map::cuda {

TRACEFLOW_WITH_CUDA void backward(const Tensor<float>& logit, const Tensor<float>& directions,
                                  const Tensor<float>& grad_colour, Tensor<float>& grad_logit,
                                  Tensor<float>& grad_directions);

}  // namespace traceflow::environment_map::cuda

#pragma once

#include "ops/loss/loss_kernels.h"

namespace traceflow::loss::cuda {

// Like loss::ssim_loss and loss::ssim, for images of one size on the device. mask: null, or H×W.
TRACEFLOW_WITH_CUDA void ssim_loss(const Tensor<float>& image, const Tensor<float>& target,
                                   const HalfWindow& window, double weight, Tensor<float>& grad_image,
                                   Mean* mean);
TRACEFLOW_WITH_CUDA void ssim(const Tensor<float>& image, const Tensor<float>& target,
                              const HalfWindow& window, const uint8_t* mask, Mean* mean);

}  // namespace traceflow::loss::cuda

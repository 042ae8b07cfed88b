#pragma once

#include "ops/lpips/lpips.h"

// How the CUDA device runs the network. Activations are pixels × channels, those of both images one below the
// other, so that a layer is computed for both at once; channels are padded with zeros to a multiple of four.
// A convolution is one matrix product for each block of pixels, whose 3×3 neighbourhoods are gathered first.
namespace traceflow::lpips::device {

// Most memory for gathered neighbourhoods, in bytes. Tests make it small.
inline int64_t patch_bytes = int64_t{64} << 20;

// lpips::distance, with the place of its value on the device.
void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              loss::Mean* value);
void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              double weight, Tensor<float>& grad_image, loss::Mean* value);

}  // namespace traceflow::lpips::device

#pragma once

#include "ops/lpips/lpips.h"

// How the CUDA device runs the network. Activations are pixels × channels, with the second image below the
// first, so that a layer is computed for both at once. Channels are zero-padded to a multiple of four. A
// convolution gathers the 3×3 neighbourhoods of a block of pixels and is one matrix product per block.
namespace traceflow::lpips::device {

// Most bytes for gathered neighbourhoods. Tests reduce it.
inline int64_t patch_bytes = int64_t{64} << 20;

// Like lpips::distance; `value` is an address on the device.
void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              loss::Mean* value);
void distance(const Network& network, const Tensor<float>& image, const Tensor<float>& target, Input input,
              double weight, Tensor<float>& grad_image, loss::Mean* value);

}  // namespace traceflow::lpips::device

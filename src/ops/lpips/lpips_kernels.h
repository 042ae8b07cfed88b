#pragma once

#include "ops/lpips/lpips.h"

// The network's layers on the CPU, each with its derivative. Activations are H×W×channels.
namespace traceflow::lpips {

// 3×3 convolution with zero padding, then max(0, ·).
Tensor<float> convolve_relu(const Tensor<float>& x, const Network::Convolution& convolution);

// Which outputs of convolve_relu are above zero: its derivative needs nothing else of them.
Tensor<uint8_t> gates_of(const Tensor<float>& y);

// dL/dx from dL/dy; sets dL/dy to zero where a gate is closed.
Tensor<float> convolve_relu_backward(Tensor<float>& grad_y, const Tensor<uint8_t>& gates,
                                     const Network::Convolution& convolution);

// The largest of each 2×2 pixels; drops a last odd row or column.
Tensor<float> halve(const Tensor<float>& x);

// Which of the four is the first with the largest value: 0 to 3 in reading order.
Tensor<uint8_t> largest_places(const Tensor<float>& x);

// Adds dL/d(halved) to dL/dx.
void halve_backward(const Tensor<float>& grad_halved, const Tensor<uint8_t>& places, Tensor<float>& grad_x);

// A stage's share of the distance, from its last features of both images. grad_a: if not null, set to weight
// · dshare/da.
double stage_distance(const Tensor<float>& a, const Tensor<float>& b, const Tensor<float>& linear,
                      double weight, Tensor<float>* grad_a);

}  // namespace traceflow::lpips

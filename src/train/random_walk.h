#pragma once

#include "base/tensor.h"

namespace traceflow {

// The input of a segmentation into two parts. All weights are 0 or more.
struct WalkTerms {
  Tensor<float> one, zero;    // H×W, evidence that a pixel belongs to the part, and that it does not
  Tensor<float> right, down;  // H×W, similarity of a pixel to the next one in its row and in its column
};

// Random walker segmentation with priors (Grady 2005, Multilabel random walker image segmentation using prior
// models): the x (H×W, in [0, 1]) that minimises
//   Σ one (x − 1)² + zero x² + Σ right (x − x_right)² + Σ down (x − x_down)²
// by conjugate gradients in double precision. Where no evidence reaches a pixel, x is 0.
Tensor<float> random_walk(const WalkTerms& terms);

}  // namespace traceflow

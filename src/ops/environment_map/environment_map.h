#pragma once

#include "base/tensor.h"
#include "scene/environment_map.h"

// Looks colours up in the learnable cube map by direction (method §9). The directions come already moved by
// the map's residual field (render/ adds it); this op is the lookup alone. Differentiable: the map's logits,
// the directions (not constrained to unit length; only their direction matters). Runs where the directions
// are.
namespace traceflow::environment_map {

// directions: R×3. colour: R×3, resized: σ of the bilinearly interpolated logits within the face, edges
// clamped. A zero or non-finite direction gives black.
template <class T>
void forward(const Tensor<T>& logit, const Tensor<T>& directions, Tensor<T>& colour);
// Adds to grad_logit ((6·S)×S×3) and grad_directions (R×3). Sums in a fixed order. A ray whose gradient is
// not finite passes none on.
template <class T>
void backward(const Tensor<T>& logit, const Tensor<T>& directions, const Tensor<T>& grad_colour,
              Tensor<T>& grad_logit, Tensor<T>& grad_directions);

}  // namespace traceflow::environment_map

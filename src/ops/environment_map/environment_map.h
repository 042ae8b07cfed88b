#pragma once

#include "base/tensor.h"
#include "scene/environment_map.h"

// Looks up colours by direction in the learnable cube map (method §9). Only does the lookup: render/ has
// already added the map's residual field to the directions. Differentiable by the map's logits and by the
// directions, whose length does not matter. Runs on the device of the directions.
namespace traceflow::environment_map {

// directions: R×3. colour: R×3, resized: σ of the logits, interpolated bilinearly in the face and clamped at
// its edges. Black for a direction that is zero or not finite.
template <class T>
void forward(const Tensor<T>& logit, const Tensor<T>& directions, Tensor<T>& colour);
// Adds to grad_logit ((6·S)×S×3) and grad_directions (R×3). Sums have a fixed order. A ray whose gradient is
// not finite adds nothing.
template <class T>
void backward(const Tensor<T>& logit, const Tensor<T>& directions, const Tensor<T>& grad_colour,
              Tensor<T>& grad_logit, Tensor<T>& grad_directions);

}  // namespace traceflow::environment_map

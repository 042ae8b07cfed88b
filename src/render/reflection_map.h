#pragma once

#include "ops/field/field.h"
#include "scene/environment_map.h"

// The environment map of a moving scene (method §9): the map's residual field moves a reflected direction,
// then the map is looked up.
namespace traceflow::reflection_map {

struct Saved {
  Tensor<float> moved;  // P×3, d + F(d, t)
  Tensor<float> residual;
  field::Saved field;
};

// directions: P×3, unit. colour: P×3, resized. deform: if false, F ≡ 0.
void forward(const EnvironmentMap& map, const Tensor<float>& directions, float time, bool deform,
             field::Precision precision, Tensor<float>& colour, Saved& saved);

// Adds to gradient (shapes of map; its field only with train_field) and sets grad_directions.
void backward(const EnvironmentMap& map, const Tensor<float>& directions, float time, bool deform,
              bool train_field, const Saved& saved, const Tensor<float>& grad_colour,
              EnvironmentMap& gradient, Tensor<float>& grad_directions);

}  // namespace traceflow::reflection_map

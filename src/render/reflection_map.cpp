#include "render/reflection_map.h"

#include "base/parallel.h"
#include "ops/environment_map/environment_map.h"
#include "render/frame_kernels.h"

namespace traceflow::reflection_map {

void forward(const EnvironmentMap& map, const Tensor<float>& directions, float time, bool deform,
             field::Precision precision, Tensor<float>& colour, Saved& saved) {
  saved.moved = directions;
  if (deform && map.field) {
    field::forward(*map.field, directions, time, precision, saved.residual, &saved.field);
    parallel_for(directions.device(), "render: move directions", saved.moved.size(),
                 AddNumbers{saved.residual.data(), saved.moved.data()});
  }
  environment_map::forward(map.logit, saved.moved, colour);
}

void backward(const EnvironmentMap& map, const Tensor<float>& directions, float time, bool deform,
              bool train_field, const Saved& saved, const Tensor<float>& grad_colour,
              EnvironmentMap& gradient, Tensor<float>& grad_directions) {
  grad_directions.place(directions.device()).reset(directions.shape());
  environment_map::backward(map.logit, saved.moved, grad_colour, gradient.logit, grad_directions);
  // The field gets the direction detached. So the gradient of the moved direction is also that of both d and
  // F.
  if (deform && train_field && map.field) {
    field::backward(*map.field, directions, time, saved.field, grad_directions, *gradient.field);
  }
}

}  // namespace traceflow::reflection_map

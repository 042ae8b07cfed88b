#pragma once

#include "../motion/motion_scene.h"
#include "ops/lighting/lighting.h"

namespace traceflow::testing {

// A grid in a box that holds most of random_posed. Like a trained one it is 0 on the box's faces. bodies: on
// which light changes too.
inline Lighting random_lighting(int64_t keys, int64_t bodies, uint64_t seed = 7) {
  Random random(seed);
  Lighting lighting;
  lighting.box = random_tensor<float>({2, 3}, random, 1.0, 1.3);
  for (int64_t axis = 0; axis < 3; ++axis) lighting.box(0, axis) *= -1;
  lighting.time.resize({keys});
  for (int64_t k = 0; k < keys; ++k)
    lighting.time[k] = 0.1F + 0.8F * static_cast<float>(k) / static_cast<float>(keys);
  lighting.brightness = random_tensor<float>({keys, 4, 5, 6}, random, -0.7, 0.7);
  for (int64_t i = 0; i < lighting.brightness.size(); ++i) {
    const int64_t x = i % 6, y = i / 6 % 5, z = i / 30 % 4;
    if (x == 0 || y == 0 || z == 0 || x == 5 || y == 4 || z == 3) lighting.brightness[i] = 0;
  }
  if (bodies > 0) {
    lighting.centre = random_tensor<float>({bodies, keys, 3}, random, -0.5, 0.5);
    lighting.radius = random_tensor<float>({bodies}, random, 0.5, 2.0);
    lighting.body_brightness = random_tensor<float>({bodies, keys, 4}, random, -0.5, 0.5);
  }
  return lighting;
}

// One forward and backward pass with a random gradient, on the host.
struct LightingPass {
  PosedSurfels lit, grad_lit, grad_posed;
  Lighting grad_lighting;
};
inline LightingPass run_lighting(Device device, const Lighting& lighting, const Tensor<int32_t>& body,
                                 float time, const PosedSurfels& posed, const Tensor<int32_t>& subset = {}) {
  const Lighting there = lighting.on(device);
  const Tensor<int32_t> body_there = body.on(device), subset_there = subset.on(device);
  PosedSurfels lit = posed.on(device);
  const lighting::SavedPtr saved = lighting::make_saved();
  lighting::forward(there, body_there, time, subset_there, lit, *saved);
  const PosedSurfels grad_lit = random_gradient_like(posed);
  PosedSurfels grad_posed = grad_lit.on(device);
  Lighting grad_lighting = zeros_like<float>(there);
  lighting::backward(there, time, lit, *saved, grad_posed, &grad_lighting);
  return {lit.on(Device::cpu), grad_lit, grad_posed.on(Device::cpu), grad_lighting.on(Device::cpu)};
}

}  // namespace traceflow::testing

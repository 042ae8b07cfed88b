#pragma once

#include "math/spherical_harmonics.h"
#include "scene/surfels.h"
#include "support/gradients.h"

namespace traceflow::testing {

// Surfels with ordinary values everywhere, degree 3.
inline Surfels random_surfels(int64_t count, bool tint, uint64_t seed = 11) {
  Random random(seed);
  Surfels s;
  s.position = random_tensor<float>({count, 3}, random, -1.5, 1.5);
  s.log_scale = random_tensor<float>({count, 2}, random, -4, -1);
  s.rotation = random_tensor<float>({count, 4}, random, -1, 1);
  s.opacity_logit = random_tensor<float>({count}, random, -3, 3);
  s.sh = random_tensor<float>({count, 16, 3}, random, -1, 1);
  if (tint) s.tint_logit = random_tensor<float>({count}, random, -3, 3);
  if (tint) s.roughness_logit = random_tensor<float>({count}, random, -3, 0);
  return s;
}

template <class T>
BasicPosedSurfels<T> random_gradient_like(const BasicPosedSurfels<T>& posed, uint64_t seed = 23) {
  Random random(seed);
  const auto fill = [&](const Tensor<T>& like) { return random_tensor<T>(like.shape(), random, -1, 1); };
  return {fill(posed.position),
          fill(posed.scale),
          fill(posed.rotation),
          fill(posed.opacity),
          fill(posed.sh),
          fill(posed.tint),
          {},
          fill(posed.roughness)};
}

// f(name, tensor) for every group of posed surfels.
template <class Posed, class F>
void for_each_posed(Posed& posed, F&& f) {
  f("position", posed.position);
  f("scale", posed.scale);
  f("rotation", posed.rotation);
  f("opacity", posed.opacity);
  f("sh", posed.sh);
  if (posed.has_tint()) f("tint", posed.tint);
  if (posed.has_roughness()) f("roughness", posed.roughness);
}

template <class T>
double dot(const BasicPosedSurfels<T>& a, const BasicPosedSurfels<T>& b) {
  return dot(a.position, b.position) + dot(a.scale, b.scale) + dot(a.rotation, b.rotation) +
         dot(a.opacity, b.opacity) + dot(a.sh, b.sh) + dot(a.tint, b.tint) + dot(a.roughness, b.roughness);
}

}  // namespace traceflow::testing

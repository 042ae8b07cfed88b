#pragma once

#include <cstdint>

#include "base/random.h"
#include "scene/surfels.h"

namespace traceflow {

// Surfels with normally distributed stored values.
inline Surfels random_surfels(int64_t n, int64_t coefficients, bool tint, uint64_t seed = 7) {
  Random random(seed);
  Surfels s;
  s.position = Tensor<float>(Shape{n, 3});
  s.log_scale = Tensor<float>(Shape{n, 2});
  s.rotation = Tensor<float>(Shape{n, 4});
  s.opacity_logit = Tensor<float>(Shape{n});
  s.sh = Tensor<float>(Shape{n, coefficients, 3});
  if (tint) s.tint_logit = Tensor<float>(Shape{n});
  if (tint && coefficients > 1) s.roughness_logit = Tensor<float>(Shape{n});
  s.for_each([&](const std::string&, Tensor<float>& t) {
    for (float& v : t.values()) v = static_cast<float>(random.normal());
  });
  return s;
}

}  // namespace traceflow

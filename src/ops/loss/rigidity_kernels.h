#pragma once

#include <cmath>
#include <cstdint>

#include "math/types.h"

// One edge of the rigidity term.
namespace traceflow::loss {

// The contribution of one edge: its value, and the force from its far end on its near end, at rest and posed.
struct Edge {
  bool counts = false;
  float value = 0;
  Vec3<float> at_rest{0}, posed{0};
};

struct Ends {
  Vec3<float> rest, posed;  // far end minus near end
};

TRACEFLOW_HD inline Edge measure(const Ends& ends, float radius, float strain2) {
  const float rest_length = glm::length(ends.rest);
  const float posed_length = glm::length(ends.posed);
  const float inverse_radius = 1 / radius;
  const float e = (posed_length - rest_length) * inverse_radius;
  if (!(rest_length > 0) || !(posed_length > 0) || !std::isfinite(e)) return {};
  const float sum = e * e + strain2;
  const float slope = 2 * e * strain2 / (sum * sum) * inverse_radius;
  return {true, e * e / sum, slope / rest_length * ends.rest, -slope / posed_length * ends.posed};
}

}  // namespace traceflow::loss

#pragma once

#include <cmath>

#include "math/surfel_hit.h"

namespace traceflow::trace {

// The bounding box of a disk.
struct DiskBox {
  Vec3<float> lower, upper;

  // Larger boxes would overflow when areas and centres are computed.
  TRACEFLOW_HD bool is_bounded() const {
    constexpr float limit = 1e15F;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(lower[axis] > -limit && upper[axis] < limit)) return false;
    }
    return true;
  }
};

// The box of an ellipse with half axes along t_u and t_v of `radius` standard deviations each. Enlarged by
// the rounding error of a hit.
TRACEFLOW_HD inline DiskBox disk_box(const SurfelFrame<float>& surfel, float radius) {
  const Vec3<float> a = radius * surfel.scale.x * surfel.rotation[0];
  const Vec3<float> b = radius * surfel.scale.y * surfel.rotation[1];
  const float extent = std::fmax(glm::length(a), glm::length(b));
  constexpr float vanishing = 1e-18F;  // shorter lengths have squares of 0
  DiskBox box;
  for (int axis = 0; axis < 3; ++axis) {
    const float centre = surfel.position[axis];
    const float half = std::sqrt(a[axis] * a[axis] + b[axis] * b[axis]);
    const float margin = 2e-6F * (std::abs(centre) + extent) + vanishing;
    box.lower[axis] = centre - half - margin;
    box.upper[axis] = centre + half + margin;
  }
  return box;
}

}  // namespace traceflow::trace

#pragma once

#include <functional>

#include "base/tensor.h"
#include "math/camera.h"

namespace traceflow {

// A capture's points as samples of its surfaces at time 0. Normals come from planes through each point and
// its 12 nearest neighbours. At most 20,000 points are kept.
class SurfacePoints {
 public:
  // points: P×3.
  explicit SurfacePoints(const Tensor<float>& points);

  bool empty() const { return points_.empty(); }
  // Calls f for each point that has a normal, is in the image and is not hidden by a nearer point. depth: its
  // camera z. The normal is unit, in camera space and turned to the viewer.
  void for_each_visible(
      const Camera<float>& camera,
      const std::function<void(const Vec2<float>& pixel, float depth, const Vec3<double>& normal)>& f) const;

 private:
  Tensor<float> points_;   // P×3; empty if there are too few for planes
  Tensor<float> normals_;  // P×3, unit with arbitrary sign, zero if the neighbours lie in no plane
};

}  // namespace traceflow

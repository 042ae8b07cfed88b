#pragma once

#include <vector>

#include "base/tensor.h"
#include "math/camera.h"

namespace traceflow::show {

// What a set of cameras is about.
struct Aim {
  Vec3<double> target{0};     // what they look at
  Vec3<double> up{0, -1, 0};  // unit; the mean of their own
  double spread = 1;          // largest distance of a camera from their middle, at least 1
};

// There must be a camera.
Aim aim_of(const std::vector<Camera<float>>& cameras);

// Middle value per axis of P×3 points, which a few strays do not move; zero without points.
Vec3<double> median_point(const Tensor<float>& points);

// One of a camera's axes in world: 0 right, 1 down, 2 forward.
Vec3<double> axis_of(const Camera<float>& camera, int axis);

// v at length 1, or `otherwise` where it has no direction.
Vec3<double> unit(const Vec3<double>& v, const Vec3<double>& otherwise);

}  // namespace traceflow::show

#include "show/aim.h"

#include <algorithm>
#include <cmath>

namespace traceflow::show {

namespace {

using V = Vec3<double>;

// The point nearest to all optical axes in the least-squares sense; a little ridge keeps parallel axes
// solvable.
V point_looked_at(const std::vector<Camera<float>>& cameras, double spread) {
  Mat3<double> a(1e-6);
  V middle(0), b(0);
  for (const Camera<float>& c : cameras) middle += V(c.position) / static_cast<double>(cameras.size());
  V forward(0);
  for (const Camera<float>& c : cameras) {
    const V d = axis_of(c, 2);
    const Mat3<double> project = Mat3<double>(1.0) - outerProduct(d, d);
    a += project;
    b += project * (V(c.position) - middle);
    forward += d;
  }
  const V point = middle + inverse(a) * b;
  double ahead = 0;
  for (const Camera<float>& c : cameras) ahead += dot(point - V(c.position), axis_of(c, 2));
  if (ahead > 0 && std::isfinite(ahead)) return point;
  return middle + unit(forward, V{0, 0, 1}) * spread;
}

}  // namespace

V unit(const V& v, const V& otherwise) {
  const double length = std::sqrt(dot(v, v));
  return length > 1e-9 && std::isfinite(length) ? v / length : otherwise;
}

// Rows of camera_from_world are the camera's axes in world.
V axis_of(const Camera<float>& camera, int axis) {
  const Mat3<float>& r = camera.camera_from_world;
  return {r[0][axis], r[1][axis], r[2][axis]};
}

Aim aim_of(const std::vector<Camera<float>>& cameras) {
  require(!cameras.empty(), "an aim has cameras to go by");
  V middle(0), down(0);
  for (const Camera<float>& c : cameras) {
    middle += V(c.position) / static_cast<double>(cameras.size());
    down += axis_of(c, 1);
  }
  Aim aim;
  for (const Camera<float>& c : cameras) aim.spread = std::max(aim.spread, length(V(c.position) - middle));
  aim.up = unit(-down, V{0, -1, 0});
  aim.target = point_looked_at(cameras, aim.spread);
  return aim;
}

V median_point(const Tensor<float>& points) {
  V median(0);
  if (points.empty()) return median;
  std::vector<float> values;
  for (int axis = 0; axis < 3; ++axis) {
    values.clear();
    for (int64_t i = 0; i < points.dim(0); ++i) {
      if (std::isfinite(points(i, axis))) values.push_back(points(i, axis));
    }
    if (values.empty()) continue;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    median[axis] = *middle;
  }
  return median;
}

}  // namespace traceflow::show

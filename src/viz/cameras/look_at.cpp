#include "viz/cameras/look_at.h"

#include <algorithm>
#include <cmath>

#include "base/robust.h"

namespace traceflow::viz {

using V = Vec3<double>;

V unit(const V& v, const V& otherwise) {
  const double length = std::sqrt(dot(v, v));
  return length > 1e-9 && std::isfinite(length) ? v / length : otherwise;
}

V perpendicular(const V& v) {
  const V axis = std::abs(v.x) < 0.5 ? V{1, 0, 0} : V{0, 0, 1};
  return unit(cross(v, cross(axis, v)), V{0, 0, 1});
}

// Rows of camera_from_world are the camera's axes in world.
V axis_of(const Camera<float>& camera, int axis) {
  const Mat3<float>& r = camera.camera_from_world;
  return {r[0][axis], r[1][axis], r[2][axis]};
}

Camera<float> looking(Camera<float> camera, const V& from, const V& forward, const V& up) {
  const V x = unit(cross(forward, up), perpendicular(forward));
  camera.position = Vec3<float>(from);
  camera.camera_from_world = Mat3<float>(transpose(Mat3<double>(x, cross(forward, x), forward)));
  return camera;
}

Aim aim_of(const std::vector<Camera<float>>& cameras) {
  require(!cameras.empty(), "an aim has cameras to go by");
  Aim aim;
  V down(0), forward(0);
  for (const Camera<float>& c : cameras) {
    aim.centroid += V(c.position) / static_cast<double>(cameras.size());
    down += axis_of(c, 1);
    forward += axis_of(c, 2);
  }
  for (const Camera<float>& c : cameras)
    aim.spread = std::max(aim.spread, length(V(c.position) - aim.centroid));
  aim.up = unit(-down, V{0, -1, 0});
  aim.forward = unit(forward, V{0, 0, 1});

  // A small ridge term keeps parallel axes solvable.
  Mat3<double> a(1e-6);
  V b(0);
  for (const Camera<float>& c : cameras) {
    const V d = axis_of(c, 2);
    const Mat3<double> project = Mat3<double>(1.0) - outerProduct(d, d);
    a += project;
    b += project * (V(c.position) - aim.centroid);
  }
  aim.target = aim.centroid + inverse(a) * b;
  // For cameras at one place, or with parallel axes, the solution is at the cameras. Rounding moves it
  // slightly forward or backward, by less than this fraction of their distance from the origin. That distance
  // bounds both the size of the coordinates and the distances between cameras.
  constexpr double rounding = 1e-6;
  double ahead = 0, farthest = 0;
  for (const Camera<float>& c : cameras) {
    ahead += dot(aim.target - V(c.position), axis_of(c, 2));
    farthest = std::max(farthest, length(V(c.position)));
  }
  const double least = rounding * farthest * static_cast<double>(cameras.size());
  if (!(ahead > least) || !std::isfinite(ahead)) aim.target = aim.centroid + aim.spread * aim.forward;
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
    if (!values.empty()) median[axis] = ranked(values, values.size() / 2);
  }
  return median;
}

}  // namespace traceflow::viz

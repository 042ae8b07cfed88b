#include "show/look_at.h"

#include <cmath>

namespace traceflow::show {

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

V point_looked_at(const std::vector<Camera<float>>& cameras, double spread) {
  // A little ridge keeps parallel axes solvable.
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

}  // namespace traceflow::show

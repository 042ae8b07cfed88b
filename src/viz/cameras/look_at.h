#pragma once

#include <vector>

#include "base/tensor.h"
#include "math/camera.h"

// What cameras look at, and cameras that look at a target.
namespace traceflow::viz {

// v normalised, or `otherwise` if v is too short.
Vec3<double> unit(const Vec3<double>& v, const Vec3<double>& otherwise);

// Any unit vector perpendicular to the unit vector v.
Vec3<double> perpendicular(const Vec3<double>& v);

// A camera's x (0), y (1) or z (2) axis in world.
Vec3<double> axis_of(const Camera<float>& camera, int axis);

// The camera moved to `from`, looking along the unit vector `forward`, with `up` (unit) pointing up.
Camera<float> looking(Camera<float> camera, const Vec3<double>& from, const Vec3<double>& forward,
                      const Vec3<double>& up);

// The common target of a set of cameras.
struct Aim {
  Vec3<double> centroid{0};       // mean position of the cameras
  Vec3<double> forward{0, 0, 1};  // unit; the cameras' mean
  Vec3<double> up{0, -1, 0};      // unit; the cameras' mean
  double spread = 1;              // largest distance of a camera from the mean position, at least 1
  // The least-squares nearest point to all optical axes. If it is not in front of the cameras, as for cameras
  // at one place or with parallel axes, the point `spread` ahead of the mean position.
  Vec3<double> target{0};
};
// There must be at least one camera.
Aim aim_of(const std::vector<Camera<float>>& cameras);

// Median per axis of P×3 points, robust to outliers; zero without points.
Vec3<double> median_point(const Tensor<float>& points);

}  // namespace traceflow::viz

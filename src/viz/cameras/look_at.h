#pragma once

#include <vector>

#include "base/tensor.h"
#include "math/camera.h"

// What cameras look at, and cameras that look at something.
namespace traceflow::viz {

// v as a unit vector, or `otherwise` where it has no direction.
Vec3<double> unit(const Vec3<double>& v, const Vec3<double>& otherwise);

// Any unit vector at right angles to the unit vector v.
Vec3<double> perpendicular(const Vec3<double>& v);

// A camera's x (0), y (1) or z (2) axis in world.
Vec3<double> axis_of(const Camera<float>& camera, int axis);

// The camera moved to `from`, looking along the unit vector `forward` with `up` (unit) above.
Camera<float> looking(Camera<float> camera, const Vec3<double>& from, const Vec3<double>& forward,
                      const Vec3<double>& up);

// What a set of cameras is about.
struct Aim {
  Vec3<double> middle{0};         // of the cameras
  Vec3<double> forward{0, 0, 1};  // unit; the mean of their own
  Vec3<double> up{0, -1, 0};      // unit; likewise
  double spread = 1;              // largest distance of a camera from the middle, at least 1
  // The point nearest to all optical axes in the least-squares sense; `spread` ahead of the middle where
  // there is none before them, as of cameras at one place or with parallel axes.
  Vec3<double> target{0};
};
// There must be a camera.
Aim aim_of(const std::vector<Camera<float>>& cameras);

// Middle value per axis of P×3 points, which a few strays do not move; zero without points.
Vec3<double> median_point(const Tensor<float>& points);

}  // namespace traceflow::viz

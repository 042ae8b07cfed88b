#pragma once

#include <vector>

#include "math/camera.h"

// What cameras look at, and cameras that look at something.
namespace traceflow::show {

// v as a unit vector, or `otherwise` where it has no direction.
Vec3<double> unit(const Vec3<double>& v, const Vec3<double>& otherwise);

// Any unit vector at right angles to the unit vector v.
Vec3<double> perpendicular(const Vec3<double>& v);

// A camera's x (0), y (1) or z (2) axis in world.
Vec3<double> axis_of(const Camera<float>& camera, int axis);

// The camera moved to `from`, looking along the unit vector `forward` with `up` (unit) above.
Camera<float> looking(Camera<float> camera, const Vec3<double>& from, const Vec3<double>& forward,
                      const Vec3<double>& up);

// The point nearest to all optical axes in the least-squares sense; `spread` ahead of the cameras' middle
// where there is none before them.
Vec3<double> point_looked_at(const std::vector<Camera<float>>& cameras, double spread);

}  // namespace traceflow::show

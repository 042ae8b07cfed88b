#pragma once

#include <cmath>
#include <numbers>
#include <span>

#include "math/types.h"

namespace traceflow {

// x → scale · rotation · x + shift.
struct Similarity {
  Mat3<double> rotation{1};  // proper: without reflection
  double scale = 1;
  Vec3<double> shift{0};

  Vec3<double> operator()(const Vec3<double>& x) const { return scale * (rotation * x) + shift; }
};

// The similarity that maps the points `from` to the points `to`, of the same number, with the least sum of
// squared distances (Umeyama 1991). Its rotation is proper for any points, also coplanar or mirrored ones. If
// the rotation is ambiguous, as for collinear points, it is one of those that fit. If all points of `from`
// coincide, the rotation is the identity and the scale 1.
Similarity fit_similarity(std::span<const Vec3<double>> from, std::span<const Vec3<double>> to);

// The angle of a rotation in degrees, 0 to 180; accurate for small angles too.
inline double rotation_angle_deg(const Mat3<double>& r) {
  const Vec3<double> twice_sine(r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0]);
  const double twice_cosine = r[0][0] + r[1][1] + r[2][2] - 1;
  return std::atan2(std::sqrt(dot(twice_sine, twice_sine)), twice_cosine) * 180 / std::numbers::pi;
}

}  // namespace traceflow

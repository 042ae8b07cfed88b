#pragma once

#include <cmath>
#include <numbers>
#include <span>

#include "math/rotation.h"
#include "math/symmetric_eigen.h"

namespace traceflow {

// x → scale · rotation · x + shift.
struct Similarity {
  Mat3<double> rotation{1};  // proper: without reflection
  double scale = 1;
  Vec3<double> shift{0};

  Vec3<double> operator()(const Vec3<double>& x) const { return scale * (rotation * x) + shift; }
};

// The similarity that maps the points `from` to the points `to`, of the same number, with the least sum of
// squared distances (Horn 1987). The rotation's quaternion is the last eigenvector of a symmetric 4×4 matrix.
// So the result is a proper rotation for any points, also coplanar or mirrored ones. If the rotation is
// ambiguous, as for collinear points, it is one of those that fit. If all points of `from` coincide, the
// rotation is the identity and the scale 1.
inline Similarity fit_similarity(std::span<const Vec3<double>> from, std::span<const Vec3<double>> to) {
  const auto count = static_cast<double>(from.size());
  Vec3<double> centroid_from(0), centroid_to(0);
  for (size_t i = 0; i < from.size(); ++i) {
    centroid_from += from[i] / count;
    centroid_to += to[i] / count;
  }
  Mat3<double> moments(0);  // Σ b aᵀ
  double size = 0;          // Σ |a|²
  for (size_t i = 0; i < from.size(); ++i) {
    const Vec3<double> a = from[i] - centroid_from, b = to[i] - centroid_to;
    moments += outerProduct(b, a);
    size += dot(a, a);
  }

  // The entry for b_row · a_column.
  const auto m = [&](int row, int column) { return moments[column][row]; };
  // qᵀ n q = Σ b · R(q) a.
  glm::mat<4, 4, double, glm::defaultp> n(0);
  n[0] = {m(0, 0) + m(1, 1) + m(2, 2), m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)};
  n[1] = {n[0][1], m(0, 0) - m(1, 1) - m(2, 2), m(0, 1) + m(1, 0), m(2, 0) + m(0, 2)};
  n[2] = {n[0][2], n[1][2], m(1, 1) - m(0, 0) - m(2, 2), m(1, 2) + m(2, 1)};
  n[3] = {n[0][3], n[1][3], n[2][3], m(2, 2) - m(0, 0) - m(1, 1)};
  const auto eigen = symmetric_eigen(n);
  Similarity result;
  if (size > 0) result.scale = eigen.values[3] / size;
  if (eigen.values[3] > 0) result.rotation = rotation_from_quaternion(eigen.vectors[3]);
  result.shift = centroid_to - result.scale * (result.rotation * centroid_from);
  return result;
}

// The angle of a rotation in degrees, 0 to 180; accurate for small angles too.
inline double rotation_angle_deg(const Mat3<double>& r) {
  const Vec3<double> twice_sine(r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0]);
  const double twice_cosine = r[0][0] + r[1][1] + r[2][2] - 1;
  return std::atan2(std::sqrt(dot(twice_sine, twice_sine)), twice_cosine) * 180 / std::numbers::pi;
}

}  // namespace traceflow

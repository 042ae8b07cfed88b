#pragma once

#include <cmath>
#include <Eigen/LU>
#include <Eigen/SVD>
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
inline Similarity fit_similarity(std::span<const Vec3<double>> from, std::span<const Vec3<double>> to) {
  const auto count = static_cast<Eigen::Index>(from.size());
  const Eigen::Map<const Eigen::Matrix3Xd> a(&from.data()->x, 3, count), b(&to.data()->x, 3, count);
  const Eigen::Vector3d centroid_a = a.rowwise().mean(), centroid_b = b.rowwise().mean();
  // Not as one product: how Eigen splits a long one depends on the processor's caches.
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < count; ++i)
    moments += (b.col(i) - centroid_b) * (a.col(i) - centroid_a).transpose();
  const double size = (a.colwise() - centroid_a).squaredNorm();
  Similarity result;
  Eigen::Map<Eigen::Matrix3d> rotation(&result.rotation[0][0]);
  if (size > 0) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const bool mirrors = svd.matrixU().determinant() * svd.matrixV().determinant() < 0;
    const Eigen::Vector3d signs(1, 1, mirrors ? -1 : 1);
    rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
    result.scale = svd.singularValues().dot(signs) / size;
  }
  Eigen::Map<Eigen::Vector3d>(&result.shift.x) = centroid_b - result.scale * (rotation * centroid_a);
  return result;
}

// The angle of a rotation in degrees, 0 to 180; accurate for small angles too.
inline double rotation_angle_deg(const Mat3<double>& r) {
  const Vec3<double> twice_sine(r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0]);
  const double twice_cosine = r[0][0] + r[1][1] + r[2][2] - 1;
  return std::atan2(std::sqrt(dot(twice_sine, twice_sine)), twice_cosine) * 180 / std::numbers::pi;
}

}  // namespace traceflow

#include "math/similarity_fit.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace traceflow {

Similarity fit_similarity(std::span<const Vec3<double>> from, std::span<const Vec3<double>> to) {
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

}  // namespace traceflow

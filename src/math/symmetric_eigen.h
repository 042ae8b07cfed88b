#pragma once

#include <Eigen/Eigenvalues>

#include "math/types.h"

namespace traceflow {

// Eigenvectors (columns) and eigenvalues of a symmetric size×size matrix, with ascending eigenvalues.
template <int size, class T>
struct SymmetricEigen {
  glm::vec<size, T, glm::defaultp> values;
  glm::mat<size, size, T, glm::defaultp> vectors;
};

template <int size, class T>
SymmetricEigen<size, T> symmetric_eigen(const glm::mat<size, size, T, glm::defaultp>& a) {
  using Matrix = Eigen::Matrix<T, size, size>;
  const Eigen::SelfAdjointEigenSolver<Matrix> solver{Eigen::Map<const Matrix>(&a[0][0])};
  SymmetricEigen<size, T> result;
  Eigen::Map<Eigen::Matrix<T, size, 1>>(&result.values[0]) = solver.eigenvalues();
  Eigen::Map<Matrix>(&result.vectors[0][0]) = solver.eigenvectors();
  return result;
}

}  // namespace traceflow

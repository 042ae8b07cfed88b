#pragma once

#include <cmath>

#include "math/types.h"

namespace traceflow {

// Eigenvectors (columns) and eigenvalues of a symmetric size×size matrix (size up to 4) by Jacobi rotations,
// with ascending eigenvalues.
template <int size, class T>
struct SymmetricEigen {
  glm::vec<size, T, glm::defaultp> values;
  glm::mat<size, size, T, glm::defaultp> vectors;
};

template <int size, class T>
TRACEFLOW_HD SymmetricEigen<size, T> symmetric_eigen(glm::mat<size, size, T, glm::defaultp> a) {
  using Matrix = glm::mat<size, size, T, glm::defaultp>;
  Matrix v(T(1));
  for (int sweep = 0; sweep < 12; ++sweep) {
    for (int p = 0; p < size - 1; ++p) {
      for (int q = p + 1; q < size; ++q) {
        if (a[q][p] == T(0)) continue;
        const T theta = (a[q][q] - a[p][p]) / (T(2) * a[q][p]);
        const T t = (theta >= T(0) ? T(1) : T(-1)) / (std::abs(theta) + std::sqrt(theta * theta + T(1)));
        const T c = T(1) / std::sqrt(t * t + T(1));
        Matrix j(T(1));
        j[p][p] = c;
        j[q][q] = c;
        j[q][p] = t * c;
        j[p][q] = -t * c;
        a = transpose(j) * a * j;
        v = v * j;
      }
    }
  }
  SymmetricEigen<size, T> result;
  result.vectors = v;
  for (int i = 0; i < size; ++i) result.values[i] = a[i][i];
  for (int last = size - 1; last > 0; --last) {
    for (int i = 0; i < last; ++i) {
      if (result.values[i] <= result.values[i + 1]) continue;
      const T value = result.values[i];
      result.values[i] = result.values[i + 1];
      result.values[i + 1] = value;
      const auto column = result.vectors[i];
      result.vectors[i] = result.vectors[i + 1];
      result.vectors[i + 1] = column;
    }
  }
  return result;
}

}  // namespace traceflow

#pragma once

#include <cmath>

#include "math/types.h"

namespace traceflow {

// Eigenvectors (columns) and eigenvalues of a symmetric 3×3 matrix by Jacobi rotations, in ascending order of
// eigenvalue.
template <class T>
struct SymmetricEigen {
  Vec3<T> values;
  Mat3<T> vectors;
};

template <class T>
TRACEFLOW_HD SymmetricEigen<T> symmetric_eigen(Mat3<T> a) {
  Mat3<T> v(T(1));
  for (int sweep = 0; sweep < 12; ++sweep) {
    for (int p = 0; p < 2; ++p) {
      for (int q = p + 1; q < 3; ++q) {
        if (a[q][p] == T(0)) continue;
        const T theta = (a[q][q] - a[p][p]) / (T(2) * a[q][p]);
        const T t = (theta >= T(0) ? T(1) : T(-1)) / (std::abs(theta) + std::sqrt(theta * theta + T(1)));
        const T c = T(1) / std::sqrt(t * t + T(1));
        Mat3<T> j(T(1));
        j[p][p] = c;
        j[q][q] = c;
        j[q][p] = t * c;
        j[p][q] = -t * c;
        a = transpose(j) * a * j;
        v = v * j;
      }
    }
  }
  SymmetricEigen<T> result{{a[0][0], a[1][1], a[2][2]}, v};
  const auto order = [&](int i, int k) {
    if (result.values[i] <= result.values[k]) return;
    const T value = result.values[i];
    result.values[i] = result.values[k];
    result.values[k] = value;
    const Vec3<T> column = result.vectors[i];
    result.vectors[i] = result.vectors[k];
    result.vectors[k] = column;
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);
  return result;
}

}  // namespace traceflow

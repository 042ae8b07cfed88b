#pragma once

#include <cmath>

#include "math/spherical_harmonics.h"

// Rotation of spherical harmonics with the body that they colour: the function f'(d) = f(Rᵀ d) has the
// coefficients D c, with c those of f. D does not mix degrees; its block for degree l is (2l + 1)×(2l + 1).
namespace traceflow {

// The blocks of degrees 1 to 3, row by row.
template <class T>
struct ShRotation {
  T degree1[9], degree2[25], degree3[49];

  TRACEFLOW_HD T* block(int degree) { return degree == 1 ? degree1 : degree == 2 ? degree2 : degree3; }
  TRACEFLOW_HD const T* block(int degree) const {
    return degree == 1 ? degree1 : degree == 2 ? degree2 : degree3;
  }
};

namespace detail {

// Calls f(direction, weight) for the nodes of a quadrature on the sphere that is exact for polynomials up to
// degree 7: four Gauss–Legendre heights times eight longitudes.
template <class F>
TRACEFLOW_HD void for_each_sphere_node(F&& f) {
  constexpr double height[2] = {0.3399810435848563, 0.8611363115940526};
  constexpr double weight[2] = {0.6521451548625461, 0.34785484513745385};
  constexpr double eighth = 0.7853981633974483;  // π/4
  for (int i = 0; i < 4; ++i) {
    const double z = i % 2 == 0 ? height[i / 2] : -height[i / 2];
    const double across = std::sqrt(1 - z * z);
    for (int k = 0; k < 8; ++k) {
      f(Vec3<double>(across * std::cos(eighth * k), across * std::sin(eighth * k), z),
        weight[i / 2] * eighth);
    }
  }
}

// D_ij = ∫ Y_i(d) turned_j(d) dd, since the basis is orthonormal. turned(d, values): writes 16 numbers.
template <class T, class Turned>
TRACEFLOW_HD void project_harmonics(Turned&& turned, ShRotation<T>& result) {
  double sums[83] = {};
  for_each_sphere_node([&](const Vec3<double>& d, double weight) {
    double at[16], other[16];
    sh_basis(3, d, at);
    turned(d, other);
    double* sum = sums;
    for (int degree = 1; degree <= 3; ++degree) {
      for (int i = degree * degree; i < (degree + 1) * (degree + 1); ++i) {
        for (int j = degree * degree; j < (degree + 1) * (degree + 1); ++j)
          *sum++ += weight * at[i] * other[j];
      }
    }
  });
  const double* sum = sums;
  for (int degree = 1; degree <= 3; ++degree) {
    const int size = 2 * degree + 1;
    for (int k = 0; k < size * size; ++k) result.block(degree)[k] = static_cast<T>(*sum++);
  }
}

}  // namespace detail

template <class T>
TRACEFLOW_HD ShRotation<T> sh_rotation(const Mat3<double>& rotation) {
  ShRotation<T> result;
  detail::project_harmonics([&](const Vec3<double>& d, double* values) { sh_basis(3, d * rotation, values); },
                            result);
  return result;
}

// dD/dω of D(exp(ω)) at ω = 0 about one world axis, so that dD(exp(ω) R)/dω = this · D(R).
template <class T>
ShRotation<T> sh_generator(const Vec3<double>& axis) {
  ShRotation<T> result;
  detail::project_harmonics(
      [&](const Vec3<double>& d, double* values) {
        for (int k = 0; k < 16; ++k) {
          double chosen[16] = {};
          chosen[k] = 1;
          values[k] = -dot(sh_basis_backward(3, d, chosen), cross(axis, d));
        }
      },
      result);
  return result;
}

// to = D · from, for one surfel's coefficients (rows of 3 numbers) up to a degree. from and to must differ.
template <class T, class U>
TRACEFLOW_HD void turn_harmonics(const ShRotation<T>& d, int degree, const U* from, U* to) {
  for (int c = 0; c < 3; ++c) to[c] = from[c];
  for (int l = 1; l <= degree; ++l) {
    const int first = l * l, size = 2 * l + 1;
    const T* row = d.block(l);
    for (int i = 0; i < size; ++i, row += size) {
      for (int c = 0; c < 3; ++c) {
        T sum = 0;
        for (int j = 0; j < size; ++j) sum += row[j] * from[3 * (first + j) + c];
        to[3 * (first + i) + c] = static_cast<U>(sum);
      }
    }
  }
}

// to = Dᵀ · from, the inverse rotation.
template <class T, class U>
TRACEFLOW_HD void turn_harmonics_back(const ShRotation<T>& d, int degree, const U* from, U* to) {
  for (int c = 0; c < 3; ++c) to[c] = from[c];
  for (int l = 1; l <= degree; ++l) {
    const int first = l * l, size = 2 * l + 1;
    const T* const block = d.block(l);
    for (int i = 0; i < size; ++i) {
      for (int c = 0; c < 3; ++c) {
        T sum = 0;
        for (int j = 0; j < size; ++j) sum += block[j * size + i] * from[3 * (first + j) + c];
        to[3 * (first + i) + c] = static_cast<U>(sum);
      }
    }
  }
}

}  // namespace traceflow

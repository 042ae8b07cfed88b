#pragma once

#include "math/types.h"

// Real spherical harmonics of degrees 0..3, in the order and with the signs of 3DGS (method §1.1).
namespace traceflow {

TRACEFLOW_HD constexpr int sh_coefficients(int degree) { return (degree + 1) * (degree + 1); }
// The inverse of sh_coefficients, for 1, 4, 9 and 16.
TRACEFLOW_HD constexpr int sh_degree(int64_t coefficients) {
  return coefficients >= 16 ? 3 : coefficients >= 9 ? 2 : coefficients >= 4 ? 1 : 0;
}
inline constexpr double sh_c0 = 0.28209479177387814;

// The basis for the unit direction d; writes sh_coefficients(degree) numbers.
template <class T>
TRACEFLOW_HD void sh_basis(int degree, const Vec3<T>& d, T* basis) {
  const T x = d.x, y = d.y, z = d.z;
  basis[0] = T(sh_c0);
  if (degree < 1) return;
  basis[1] = T(-0.4886025119029199) * y;
  basis[2] = T(0.4886025119029199) * z;
  basis[3] = T(-0.4886025119029199) * x;
  if (degree < 2) return;
  const T xx = x * x, yy = y * y, zz = z * z;
  basis[4] = T(1.0925484305920792) * x * y;
  basis[5] = T(-1.0925484305920792) * y * z;
  basis[6] = T(0.31539156525252005) * (T(2) * zz - xx - yy);
  basis[7] = T(-1.0925484305920792) * x * z;
  basis[8] = T(0.5462742152960396) * (xx - yy);
  if (degree < 3) return;
  basis[9] = T(-0.5900435899266435) * y * (T(3) * xx - yy);
  basis[10] = T(2.890611442640554) * x * y * z;
  basis[11] = T(-0.4570457994644658) * y * (T(4) * zz - xx - yy);
  basis[12] = T(0.3731763325901154) * z * (T(2) * zz - T(3) * xx - T(3) * yy);
  basis[13] = T(-0.4570457994644658) * x * (T(4) * zz - xx - yy);
  basis[14] = T(1.445305721320277) * z * (xx - yy);
  basis[15] = T(-0.5900435899266435) * x * (xx - T(3) * yy);
}

// Σ_k weight[k] ∂basis[k]/∂d, with d unconstrained (not restricted to the sphere).
template <class T>
TRACEFLOW_HD Vec3<T> sh_basis_backward(int degree, const Vec3<T>& d, const T* weight) {
  const T x = d.x, y = d.y, z = d.z;
  Vec3<T> g(T(0));
  if (degree < 1) return g;
  g.y += T(-0.4886025119029199) * weight[1];
  g.z += T(0.4886025119029199) * weight[2];
  g.x += T(-0.4886025119029199) * weight[3];
  if (degree < 2) return g;
  g += T(1.0925484305920792) * weight[4] * Vec3<T>(y, x, T(0));
  g += T(-1.0925484305920792) * weight[5] * Vec3<T>(T(0), z, y);
  g += T(0.31539156525252005) * weight[6] * Vec3<T>(-T(2) * x, -T(2) * y, T(4) * z);
  g += T(-1.0925484305920792) * weight[7] * Vec3<T>(z, T(0), x);
  g += T(0.5462742152960396) * weight[8] * Vec3<T>(T(2) * x, -T(2) * y, T(0));
  if (degree < 3) return g;
  const T xx = x * x, yy = y * y, zz = z * z;
  g += T(-0.5900435899266435) * weight[9] * Vec3<T>(T(6) * x * y, T(3) * (xx - yy), T(0));
  g += T(2.890611442640554) * weight[10] * Vec3<T>(y * z, x * z, x * y);
  g += T(-0.4570457994644658) * weight[11] * Vec3<T>(-T(2) * x * y, T(4) * zz - xx - T(3) * yy, T(8) * y * z);
  g += T(0.3731763325901154) * weight[12] *
       Vec3<T>(-T(6) * x * z, -T(6) * y * z, T(6) * zz - T(3) * xx - T(3) * yy);
  g += T(-0.4570457994644658) * weight[13] * Vec3<T>(T(4) * zz - T(3) * xx - yy, -T(2) * x * y, T(8) * x * z);
  g += T(1.445305721320277) * weight[14] * Vec3<T>(T(2) * x * z, -T(2) * y * z, xx - yy);
  g += T(-0.5900435899266435) * weight[15] * Vec3<T>(T(3) * (xx - yy), -T(6) * x * y, T(0));
  return g;
}

// c = max(0, Σ_k sh[k] basis[k] + 0.5) per channel; sh has sh_coefficients(degree) rows of 3.
template <class T, class U>
TRACEFLOW_HD Vec3<T> sh_colour(int degree, const U* sh, const Vec3<T>& direction) {
  T basis[16];
  sh_basis(degree, direction, basis);
  Vec3<T> c(T(0.5));
  for (int k = 0; k < sh_coefficients(degree); ++k) c += basis[k] * load3<T>(sh + 3 * k);
  return glm::max(c, Vec3<T>(T(0)));
}

// Adds dL/dsh to grad_sh and returns dL/ddirection, with an unconstrained direction. A channel clamped at
// zero has no gradient.
template <class T, class U>
TRACEFLOW_HD Vec3<T> sh_colour_backward(int degree, const U* sh, const Vec3<T>& direction,
                                        Vec3<T> grad_colour, U* grad_sh) {
  T basis[16];
  sh_basis(degree, direction, basis);
  Vec3<T> c(T(0.5));
  const int count = sh_coefficients(degree);
  for (int k = 0; k < count; ++k) c += basis[k] * load3<T>(sh + 3 * k);
  for (int channel = 0; channel < 3; ++channel) {
    if (!(c[channel] > T(0))) grad_colour[channel] = T(0);
  }
  T weight[16];
  for (int k = 0; k < count; ++k) {
    weight[k] = dot(grad_colour, load3<T>(sh + 3 * k));
    add3(grad_sh + 3 * k, basis[k] * grad_colour);
  }
  return sh_basis_backward(degree, direction, weight);
}

}  // namespace traceflow

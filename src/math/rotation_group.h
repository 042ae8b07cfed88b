#pragma once

#include <cmath>

#include "math/rotation.h"

// The rotation group (Sola et al. 2018, A micro Lie theory): exponential, logarithm and the Jacobians for
// their derivatives. Rotation vectors are in radians. A perturbation δ multiplies from the left, as in exp(δ)
// R.
namespace traceflow {

// The quaternion product a · b, in the order (w, x, y, z): first rotates by b, then by a.
template <class T>
TRACEFLOW_HD Vec4<T> quaternion_product(const Vec4<T>& a, const Vec4<T>& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}
template <class T>
TRACEFLOW_HD Vec4<T> quaternion_conjugate(const Vec4<T>& q) {
  return {q[0], -q[1], -q[2], -q[3]};
}
// q/|q|; the identity for a zero quaternion.
template <class T>
TRACEFLOW_HD Vec4<T> unit_quaternion(const Vec4<T>& q) {
  const T length2 = dot(q, q);
  return length2 > T(0) ? q / std::sqrt(length2) : Vec4<T>(T(1), T(0), T(0), T(0));
}

// A unit quaternion that rotates z to the unit vector n by the smallest angle; for n = −z a half turn about
// x.
template <class T>
TRACEFLOW_HD Vec4<T> quaternion_towards(const Vec3<T>& n) {
  if (n.z < T(-0.9999)) return {T(0), T(1), T(0), T(0)};
  const Vec4<T> q(T(1) + n.z, -n.y, n.x, T(0));
  return q / length(q);
}

// The unit quaternion of a rotation vector.
template <class T>
TRACEFLOW_HD Vec4<T> quaternion_exp(const Vec3<T>& v) {
  const T angle = std::sqrt(dot(v, v));
  const T s = angle < T(1e-6) ? T(0.5) - angle * angle / T(48) : std::sin(angle / T(2)) / angle;
  return {std::cos(angle / T(2)), s * v.x, s * v.y, s * v.z};
}
// The shortest rotation vector of a unit quaternion.
template <class T>
TRACEFLOW_HD Vec3<T> quaternion_log(Vec4<T> q) {
  if (q[0] < T(0)) q = -q;
  const Vec3<T> v(q[1], q[2], q[3]);
  const T sine = std::sqrt(dot(v, v));
  return (sine < T(1e-7) ? T(2) : T(2) * std::atan2(sine, q[0]) / sine) * v;
}

// J(v) · x: exp(v + dv) = exp(J(v) dv) exp(v). Its transpose is J(-v).
template <class T>
TRACEFLOW_HD Vec3<T> left_jacobian(const Vec3<T>& v, const Vec3<T>& x) {
  const T angle2 = dot(v, v), angle = std::sqrt(angle2);
  const T a = angle < T(1e-3) ? T(0.5) - angle2 / T(24) : (T(1) - std::cos(angle)) / angle2;
  const T b = angle < T(1e-2) ? T(1) / T(6) - angle2 / T(120) : (angle - std::sin(angle)) / (angle2 * angle);
  const Vec3<T> vx = cross(v, x);
  return x + a * vx + b * cross(v, vx);
}
// J(v)⁻¹ · x, for |v| < 2π. Its transpose is J(-v)⁻¹.
template <class T>
TRACEFLOW_HD Vec3<T> left_jacobian_inverse(const Vec3<T>& v, const Vec3<T>& x) {
  const T angle2 = dot(v, v), angle = std::sqrt(angle2);
  const T b = angle < T(1e-2) ? T(1) / T(12) + angle2 / T(720)
                              : (T(1) - angle * std::sin(angle) / (T(2) * (T(1) - std::cos(angle)))) / angle2;
  const Vec3<T> vx = cross(v, x);
  return x - T(0.5) * vx + b * cross(v, vx);
}

// dL/dq of a quaternion of any length from dL/dδ of its rotation.
template <class T>
TRACEFLOW_HD Vec4<T> quaternion_gradient(const Vec4<T>& q, const Vec3<T>& grad) {
  const T length2 = dot(q, q);
  if (!(length2 > T(0))) return Vec4<T>(T(0));
  return quaternion_product(Vec4<T>(T(0), grad.x, grad.y, grad.z), q) * (T(2) / length2);
}
// dL/dδ of a quaternion's rotation from dL/dq, for a loss that does not depend on the quaternion's length.
template <class T>
TRACEFLOW_HD Vec3<T> quaternion_torque(const Vec4<T>& q, const Vec4<T>& grad) {
  const Vec4<T> turned = quaternion_product(grad, quaternion_conjugate(q));
  return Vec3<T>(turned[1], turned[2], turned[3]) * T(0.5);
}

}  // namespace traceflow

#pragma once

#include <cmath>

#include "math/types.h"

// A surfel's frame from its quaternion (method §1.1). Quaternions are stored as (w, x, y, z), with any
// length.
namespace traceflow {

// Columns t_u, t_v, n of the rotation of q/|q|. The identity for a zero quaternion.
template <class T>
TRACEFLOW_HD Mat3<T> rotation_from_quaternion(const Vec4<T>& q) {
  const T length2 = dot(q, q);
  if (!(length2 > T(0))) return Mat3<T>(T(1));
  const T s = T(2) / length2;
  const T w = q[0], x = q[1], y = q[2], z = q[3];
  return Mat3<T>(T(1) - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y),   // t_u
                 s * (x * y - w * z), T(1) - s * (x * x + z * z), s * (y * z + w * x),   // t_v
                 s * (x * z + w * y), s * (y * z - w * x), T(1) - s * (x * x + y * y));  // n
}

// dL/dq from dL/dR, for the unnormalised q. Zero for a zero quaternion.
template <class T>
TRACEFLOW_HD Vec4<T> rotation_from_quaternion_backward(const Vec4<T>& q, const Mat3<T>& grad_rotation) {
  const T length2 = dot(q, q);
  if (!(length2 > T(0))) return Vec4<T>(T(0));
  const T inv_length = T(1) / std::sqrt(length2);
  const T w = q[0] * inv_length, x = q[1] * inv_length, y = q[2] * inv_length, z = q[3] * inv_length;
  const Mat3<T>& g = grad_rotation;  // g[column][row]
  Vec4<T> grad;
  grad[0] = T(2) * (x * (g[1][2] - g[2][1]) + y * (g[2][0] - g[0][2]) + z * (g[0][1] - g[1][0]));
  grad[1] = T(2) * (-T(2) * x * (g[1][1] + g[2][2]) + y * (g[0][1] + g[1][0]) + z * (g[0][2] + g[2][0]) +
                    w * (g[1][2] - g[2][1]));
  grad[2] = T(2) * (x * (g[0][1] + g[1][0]) - T(2) * y * (g[0][0] + g[2][2]) + z * (g[1][2] + g[2][1]) +
                    w * (g[2][0] - g[0][2]));
  grad[3] = T(2) * (x * (g[0][2] + g[2][0]) + y * (g[1][2] + g[2][1]) - T(2) * z * (g[0][0] + g[1][1]) +
                    w * (g[0][1] - g[1][0]));
  const Vec4<T> unit(w, x, y, z);
  return (grad - dot(unit, grad) * unit) * inv_length;
}

}  // namespace traceflow

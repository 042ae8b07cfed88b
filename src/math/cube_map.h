#pragma once

#include <cmath>

#include "math/types.h"

// Where a direction meets the faces of a cube (method §9), in OpenGL's layout.
namespace traceflow {

// Faces 0..5 are +x −x +y −y +z −z; (s, t) in [0,1] are coordinates on the face, t downwards. The length of d
// does not matter; d is finite and not zero.
template <class T>
struct CubeCoordinates {
  int face;
  T s, t;
};

// The axes of a face: d[major] = ±|major|, s runs along sign_s·d[axis_s], t along sign_t·d[axis_t].
struct CubeFace {
  int major, axis_s, axis_t;
  int sign_s, sign_t;
};

TRACEFLOW_HD constexpr CubeFace cube_face(int face) {
  switch (face) {
    case 0:
      return {0, 2, 1, -1, -1};
    case 1:
      return {0, 2, 1, 1, -1};
    case 2:
      return {1, 0, 2, 1, 1};
    case 3:
      return {1, 0, 2, 1, -1};
    case 4:
      return {2, 0, 1, 1, -1};
    default:
      return {2, 0, 1, -1, -1};
  }
}

template <class T>
TRACEFLOW_HD CubeCoordinates<T> cube_coordinates(const Vec3<T>& d) {
  const T x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z);
  const int major = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
  const int face = 2 * major + (d[major] < T(0) ? 1 : 0);
  const CubeFace f = cube_face(face);
  // A quotient, because the inverse of a tiny number would be infinite.
  const T length = std::abs(d[major]);
  return {face, T(0.5) + T(0.5) * static_cast<T>(f.sign_s) * (d[f.axis_s] / length),
          T(0.5) + T(0.5) * static_cast<T>(f.sign_t) * (d[f.axis_t] / length)};
}

// dL/dd from dL/ds and dL/dt.
template <class T>
TRACEFLOW_HD Vec3<T> cube_coordinates_backward(const Vec3<T>& d, const CubeCoordinates<T>& at, T grad_s,
                                               T grad_t) {
  const CubeFace f = cube_face(at.face);
  const T inverse = T(1) / std::abs(d[f.major]);
  Vec3<T> grad(T(0));
  grad[f.axis_s] = T(0.5) * static_cast<T>(f.sign_s) * inverse * grad_s;
  grad[f.axis_t] = T(0.5) * static_cast<T>(f.sign_t) * inverse * grad_t;
  // s and t are the same for every multiple of d, so the gradient has no component along d.
  grad[f.major] = -(grad[f.axis_s] * d[f.axis_s] + grad[f.axis_t] * d[f.axis_t]) / d[f.major];
  return grad;
}

}  // namespace traceflow

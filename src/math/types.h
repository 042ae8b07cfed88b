#pragma once

#include <glm/glm.hpp>

#include "base/device.h"

// Small vectors. glm matrices are column-major: m[c] is a column, and m * v is the usual product.
namespace traceflow {

template <class T>
using Vec2 = glm::vec<2, T, glm::defaultp>;
template <class T>
using Vec3 = glm::vec<3, T, glm::defaultp>;
template <class T>
using Vec4 = glm::vec<4, T, glm::defaultp>;
template <class T>
using Mat3 = glm::mat<3, 3, T, glm::defaultp>;

// Reads three (four) consecutive numbers as a vector, converted to T.
template <class T, class U>
TRACEFLOW_HD Vec3<T> load3(const U* p) {
  return {static_cast<T>(p[0]), static_cast<T>(p[1]), static_cast<T>(p[2])};
}
template <class T, class U>
TRACEFLOW_HD Vec4<T> load4(const U* p) {
  return {static_cast<T>(p[0]), static_cast<T>(p[1]), static_cast<T>(p[2]), static_cast<T>(p[3])};
}
template <class T, class U>
TRACEFLOW_HD void store3(U* p, const Vec3<T>& v) {
  p[0] = static_cast<U>(v.x);
  p[1] = static_cast<U>(v.y);
  p[2] = static_cast<U>(v.z);
}
template <class T, class U>
TRACEFLOW_HD void add3(U* p, const Vec3<T>& v) {
  p[0] += static_cast<U>(v.x);
  p[1] += static_cast<U>(v.y);
  p[2] += static_cast<U>(v.z);
}

}  // namespace traceflow

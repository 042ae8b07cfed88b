#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <type_traits>

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

template <class T>
TRACEFLOW_HD bool is_finite(const Vec3<T>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
// Whether all n numbers are finite, without branches, so that compilers vectorise it.
template <class T>
TRACEFLOW_HD bool all_finite(const T* values, int64_t n) {
  using Bits = std::conditional_t<sizeof(T) == 4, uint32_t, uint64_t>;
  constexpr Bits exponent = sizeof(T) == 4 ? Bits(0x7f800000U) : Bits(0x7ff0000000000000U);
  Bits bad = 0;
  for (int64_t i = 0; i < n; ++i)
    bad |= static_cast<Bits>((std::bit_cast<Bits>(values[i]) & exponent) == exponent);
  return bad == 0;
}

}  // namespace traceflow

#pragma once

#include <cmath>

#include "math/types.h"

// The normal of a surface from its points at neighbouring pixels (method §4.2), and its derivative.
namespace traceflow {

// normalised(down × across), which faces the camera. across: x(right) − x(left); down: x(below) − x(above).
// Zero if the product vanishes or is not finite.
template <class T>
TRACEFLOW_HD Vec3<T> pseudo_normal(const Vec3<T>& across, const Vec3<T>& down) {
  const Vec3<T> product = cross(down, across);
  const T length2 = dot(product, product);
  if (!(length2 > T(0)) || !std::isfinite(length2)) return Vec3<T>(T(0));
  return product / std::sqrt(length2);
}

template <class T>
struct PseudoNormalGradient {
  Vec3<T> across{T(0)};
  Vec3<T> down{T(0)};
};

// Zero if the normal is zero.
template <class T>
TRACEFLOW_HD PseudoNormalGradient<T> pseudo_normal_backward(const Vec3<T>& across, const Vec3<T>& down,
                                                            const Vec3<T>& grad_normal) {
  const Vec3<T> product = cross(down, across);
  const T length2 = dot(product, product);
  if (!(length2 > T(0)) || !std::isfinite(length2)) return {};
  const T inv_length = T(1) / std::sqrt(length2);
  const Vec3<T> normal = product * inv_length;
  const Vec3<T> grad_product = (grad_normal - dot(normal, grad_normal) * normal) * inv_length;
  return {cross(grad_product, down), cross(across, grad_product)};
}

}  // namespace traceflow

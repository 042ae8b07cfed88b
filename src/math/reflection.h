#pragma once

#include <cmath>

#include "math/types.h"

// A ray reflected at a surface (method §4.3), and its derivative.
namespace traceflow {

// d − 2(d·n̂)n̂ with d and n̂ the unit directions of `ray` and `normal`. Zero if either is zero or not
// finite.
template <class T>
TRACEFLOW_HD Vec3<T> reflect(const Vec3<T>& ray, const Vec3<T>& normal) {
  const T ray2 = dot(ray, ray);
  const T normal2 = dot(normal, normal);
  if (!(ray2 > T(0)) || !(normal2 > T(0)) || !std::isfinite(ray2) || !std::isfinite(normal2)) {
    return Vec3<T>(T(0));
  }
  const Vec3<T> d = ray / std::sqrt(ray2);
  const Vec3<T> n = normal / std::sqrt(normal2);
  return d - T(2) * dot(d, n) * n;
}

template <class T>
struct ReflectionGradient {
  Vec3<T> ray{T(0)};
  Vec3<T> normal{T(0)};
};

// The derivative by the ray and the normal as given, of any length. Zero if the reflection is zero.
template <class T>
TRACEFLOW_HD ReflectionGradient<T> reflect_backward(const Vec3<T>& ray, const Vec3<T>& normal,
                                                    const Vec3<T>& grad_reflected) {
  const T ray2 = dot(ray, ray);
  const T normal2 = dot(normal, normal);
  if (!(ray2 > T(0)) || !(normal2 > T(0)) || !std::isfinite(ray2) || !std::isfinite(normal2)) return {};
  const T inv_ray = T(1) / std::sqrt(ray2);
  const T inv_normal = T(1) / std::sqrt(normal2);
  const Vec3<T> d = ray * inv_ray;
  const Vec3<T> n = normal * inv_normal;
  const Vec3<T>& g = grad_reflected;
  const Vec3<T> grad_d = g - T(2) * dot(g, n) * n;
  const Vec3<T> grad_n = T(-2) * (dot(g, n) * d + dot(d, n) * g);
  return {(grad_d - dot(d, grad_d) * d) * inv_ray, (grad_n - dot(n, grad_n) * n) * inv_normal};
}

}  // namespace traceflow

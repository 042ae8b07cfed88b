#pragma once

#include <cmath>

#include "math/types.h"

// The intersection of a ray and a surfel (method §3.1, §5.1), and its derivative.
namespace traceflow {

// A surfel in space: centre, axes (columns t_u, t_v, n) and the two standard deviations along t_u and t_v.
template <class T>
struct SurfelFrame {
  Vec3<T> position;
  Mat3<T> rotation;
  Vec2<T> scale;
};

// The intersection of the ray origin + t·direction with the surfel's plane; (u, v) in standard deviations.
// `valid` is false for a ray parallel to the plane.
template <class T>
struct SurfelHit {
  T t, u, v;
  bool valid;
};

template <class T>
TRACEFLOW_HD SurfelHit<T> intersect(const SurfelFrame<T>& s, const Vec3<T>& origin,
                                    const Vec3<T>& direction) {
  const Vec3<T>& n = s.rotation[2];
  const T facing = dot(n, direction);
  if (facing == T(0)) return {T(0), T(0), T(0), false};
  const T t = dot(n, s.position - origin) / facing;
  const Vec3<T> x = origin + t * direction - s.position;
  return {t, dot(s.rotation[0], x) / s.scale.x, dot(s.rotation[1], x) / s.scale.y, true};
}

template <class T>
struct SurfelHitGradient {
  Vec3<T> position{T(0)};
  Mat3<T> rotation{T(0)};
  Vec2<T> scale{T(0)};
  Vec3<T> origin{T(0)};
  Vec3<T> direction{T(0)};
};

// The derivatives of a valid hit by all inputs, from dL/dt, dL/du and dL/dv.
template <class T>
TRACEFLOW_HD SurfelHitGradient<T> intersect_backward(const SurfelFrame<T>& s, const Vec3<T>& origin,
                                                     const Vec3<T>& direction, const SurfelHit<T>& hit,
                                                     T grad_t, T grad_u, T grad_v) {
  const Vec3<T>& n = s.rotation[2];
  const T facing = dot(n, direction);
  const Vec3<T> x = origin + hit.t * direction - s.position;
  const T gu = grad_u / s.scale.x;
  const T gv = grad_v / s.scale.y;
  const Vec3<T> grad_x = gu * s.rotation[0] + gv * s.rotation[1];

  SurfelHitGradient<T> g;
  g.scale = {-grad_u * hit.u / s.scale.x, -grad_v * hit.v / s.scale.y};
  g.rotation[0] = gu * x;
  g.rotation[1] = gv * x;
  // t = n·(p - o) / (n·d); x depends on t too.
  const T grad_t_all = grad_t + dot(grad_x, direction);
  const T a = grad_t_all / facing;
  g.rotation[2] = -a * x;
  g.position = a * n - grad_x;
  g.origin = grad_x - a * n;
  g.direction = hit.t * g.origin;
  return g;
}

}  // namespace traceflow

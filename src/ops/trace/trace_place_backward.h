#pragma once

#include "ops/trace/trace_backward.h"

namespace traceflow::trace {

// What is known of a hit before its place is looked at.
struct HitGradient {
  float distance;
  float grad_exponent;  // dL/d(log of the opacity at the hit)
  float grad_distance;
};

// Sets the parts of one hit, and adds what its place does to the ray: dL/d of the origin, and of the
// direction as a change of a unit vector. The CPU does 16 hits at once (cpu/geometry-inl.h).
TRACEFLOW_HD inline void place_backward(const BackwardFrame& f, const UnitRay& ray, const HitGradient& hit,
                                        float* parts, Vec3<float>& grad_origin, Vec3<float>& grad_direction) {
  const Vec3<float> x = ray.origin - f.position + hit.distance * ray.direction;
  const float along_u = dot(f.t_u, x), along_v = dot(f.t_v, x);
  const float u = along_u * f.inverse_scale.x, v = along_v * f.inverse_scale.y;
  const float pull_u = hit.grad_exponent * u * f.inverse_scale.x;  // -dL/d(along t_u)
  const float pull_v = hit.grad_exponent * v * f.inverse_scale.y;
  const Vec3<float> grad_x = -pull_u * f.t_u - pull_v * f.t_v;
  const float a = (hit.grad_distance + dot(grad_x, ray.direction)) / dot(f.normal, ray.direction);
  parts[part::position] = pull_u;
  parts[part::position + 1] = pull_v;
  parts[part::position + 2] = a;
  parts[part::turn] = a * along_v;
  parts[part::turn + 1] = -a * along_u;
  parts[part::turn + 2] = pull_v * along_u - pull_u * along_v;
  parts[part::scale] = pull_u * u;
  parts[part::scale + 1] = pull_v * v;
  parts[part::opacity] = hit.grad_exponent * f.inverse_opacity;
  for (size_t k = 0; k < 3; ++k) parts[part::signal + k] = 0.5F * hit.distance * parts[part::position + k];
  const Vec3<float> moved = grad_x - a * f.normal;
  grad_origin += moved;
  grad_direction += hit.distance * moved;
}

}  // namespace traceflow::trace

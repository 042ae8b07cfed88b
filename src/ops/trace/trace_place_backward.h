#pragma once

#include "ops/trace/trace_backward.h"

namespace traceflow::trace {

// The gradients of a hit that do not depend on its position in the surfel.
struct HitGradient {
  float distance;
  float grad_exponent;  // dL/d(log of the opacity at the hit)
  float grad_distance;
};

// The derivatives of a hit by one axis (t_u or t_v). along: -dL/d(position along the axis). scale:
// dL/d(scale). A cone widens the disk by a Gaussian of variance spread2; adds to by_spread2, which is -2
// dL/d(spread2).
struct AxisGradient {
  float along, scale;
};
TRACEFLOW_HD inline AxisGradient axis_backward(float grad_exponent, float along, float inverse_scale,
                                               float spread2, float& by_spread2) {
  const float scale = 1 / inverse_scale;
  const float precision = 1 / (scale * scale + spread2);
  const float u = along * precision;
  // Twice the loss of the exponent by widening, which lowers the peak and flattens the slope.
  const float lost = grad_exponent * (precision - u * u);
  by_spread2 += lost;
  // The height of the peak is scale · √precision.
  return {grad_exponent * u, grad_exponent * inverse_scale - scale * lost};
}

// Sets the contributions of one hit and adds the effect of its position to the ray. The CPU processes several
// hits at once (cpu/geometry-inl.h).
TRACEFLOW_HD inline void place_backward(const BackwardFrame& f, const UnitRay& ray, const HitGradient& hit,
                                        float* parts, GradRay& grad_ray) {
  const Vec3<float> x = ray.origin - f.position + hit.distance * ray.direction;
  const float along_u = dot(f.t_u, x), along_v = dot(f.t_v, x);
  const float spread = ray.width * hit.distance;
  AxisGradient by_u, by_v;
  float grad_distance = hit.grad_distance;
  if (ray.width > 0) {
    float by_spread2 = 0;
    by_u = axis_backward(hit.grad_exponent, along_u, f.inverse_scale.x, spread * spread, by_spread2);
    by_v = axis_backward(hit.grad_exponent, along_v, f.inverse_scale.y, spread * spread, by_spread2);
    grad_distance -= by_spread2 * spread * ray.width;
    grad_ray.width -= by_spread2 * spread * hit.distance;
  } else {
    const float u = along_u * f.inverse_scale.x, v = along_v * f.inverse_scale.y;
    by_u.along = hit.grad_exponent * u * f.inverse_scale.x;
    by_v.along = hit.grad_exponent * v * f.inverse_scale.y;
    by_u.scale = by_u.along * u;
    by_v.scale = by_v.along * v;
  }
  const float grad_u = by_u.along, grad_v = by_v.along;
  const Vec3<float> grad_x = -grad_u * f.t_u - grad_v * f.t_v;
  const float a = (grad_distance + dot(grad_x, ray.direction)) / dot(f.normal, ray.direction);
  parts[part::position] = grad_u;
  parts[part::position + 1] = grad_v;
  parts[part::position + 2] = a;
  parts[part::turn] = a * along_v;
  parts[part::turn + 1] = -a * along_u;
  parts[part::turn + 2] = grad_v * along_u - grad_u * along_v;
  parts[part::scale] = by_u.scale;
  parts[part::scale + 1] = by_v.scale;
  parts[part::opacity] = hit.grad_exponent * f.inverse_opacity;
  for (size_t k = 0; k < 3; ++k) parts[part::signal + k] = 0.5F * hit.distance * parts[part::position + k];
  const Vec3<float> moved = grad_x - a * f.normal;
  grad_ray.origin += moved;
  grad_ray.direction += hit.distance * moved;
}

}  // namespace traceflow::trace

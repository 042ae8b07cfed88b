// Differentiates the geometry of a ray's hits, one hit per lane. Compiled once per target.
#if defined(TRACEFLOW_TRACE_GEOMETRY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_GEOMETRY_INL_H
#undef TRACEFLOW_TRACE_GEOMETRY_INL_H
#else
#define TRACEFLOW_TRACE_GEOMETRY_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "ops/trace/trace_backward.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using HitTag = hn::CappedTag<float, 16>;
using HitVec = hn::Vec<HitTag>;
inline constexpr size_t hit_lanes = hn::MaxLanes(HitTag());

// Three coordinates, one hit per lane.
struct HitVec3 {
  HitVec x, y, z;
};
HWY_INLINE HitVec3 spread(const Vec3<float>& v) {
  const HitTag d;
  return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)};
}
HWY_INLINE HitVec dot(const HitVec3& a, const HitVec3& b) {
  return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x)));
}
// a + s b
HWY_INLINE HitVec3 add_scaled(const HitVec3& a, HitVec s, const HitVec3& b) {
  return {hn::MulAdd(s, b.x, a.x), hn::MulAdd(s, b.y, a.y), hn::MulAdd(s, b.z, a.z)};
}
// v in the lanes of the mask, zero in the others.
HWY_INLINE HitVec3 keep_lanes(hn::Mask<HitTag> mask, const HitVec3& v) {
  return {hn::IfThenElseZero(mask, v.x), hn::IfThenElseZero(mask, v.y), hn::IfThenElseZero(mask, v.z)};
}
HWY_INLINE Vec3<float> sum_lanes(const HitVec3& v) {
  const HitTag d;
  return {hn::GetLane(hn::SumOfLanes(d, v.x)), hn::GetLane(hn::SumOfLanes(d, v.y)),
          hn::GetLane(hn::SumOfLanes(d, v.z))};
}

// Backward frames, one hit per lane.
struct HitFrames {
  HitVec3 position, t_u, t_v, normal;
  HitVec inverse_scale_u, inverse_scale_v, inverse_opacity;

  // Lanes from `count` on repeat the last hit.
  HWY_INLINE HitFrames(const BackwardFrame* HWY_RESTRICT frames, const uint32_t* HWY_RESTRICT surfels,
                       size_t count) {
    const HitTag d;
    HWY_ALIGN float quads[4][4 * hit_lanes];
    for (size_t lane = 0; lane < hit_lanes; ++lane) {
      const auto* from = reinterpret_cast<const float*>(frames + surfels[std::min(lane, count - 1)]);
      for (size_t q = 0; q < 4; ++q) std::copy_n(from + 4 * q, 4, quads[q] + 4 * lane);
    }
    HitVec unused;
    hn::LoadInterleaved4(d, quads[0], position.x, position.y, position.z, t_u.x);
    hn::LoadInterleaved4(d, quads[1], t_u.y, t_u.z, t_v.x, t_v.y);
    hn::LoadInterleaved4(d, quads[2], t_v.z, normal.x, normal.y, normal.z);
    hn::LoadInterleaved4(d, quads[3], inverse_scale_u, inverse_scale_v, inverse_opacity, unused);
  }
};

// The gradients of each hit of a ray, in arrays with room for one vector past the end.
struct HitGradients {
  const uint32_t* surfel;
  float* const* row;           // of the hit's surfel
  const float* distance;       // scene units
  const float* grad_exponent;  // dL/d(log of the opacity at the hit)
  const float* grad_distance;
  size_t count;
};

// The derivatives of a hit by one axis (t_u or t_v). along: -dL/d(position along the axis). scale:
// dL/d(scale).
struct AxisGradient {
  HitVec along, scale;
};
HWY_INLINE AxisGradient axis_gradient(HitVec grad_exponent, HitVec along, HitVec inverse_scale) {
  const HitVec u = hn::Mul(along, inverse_scale);
  const HitVec grad_along = hn::Mul(hn::Mul(grad_exponent, u), inverse_scale);
  return {grad_along, hn::Mul(grad_along, u)};
}
// The same for a disk that a cone widens by a Gaussian of variance `spread2`. Adds to by_spread2, which is -2
// dL/d(spread2).
HWY_INLINE AxisGradient axis_gradient_widened(HitVec grad_exponent, HitVec along, HitVec inverse_scale,
                                              HitVec spread2, HitVec& by_spread2) {
  const HitTag d;
  const HitVec one = hn::Set(d, 1.0F), scale = hn::Div(one, inverse_scale);
  const HitVec precision = hn::Div(one, hn::MulAdd(scale, scale, spread2));
  const HitVec u = hn::Mul(along, precision);
  // Twice the loss of the exponent by widening, which lowers the peak and flattens the slope.
  const HitVec lost = hn::Mul(grad_exponent, hn::NegMulAdd(u, u, precision));
  by_spread2 = hn::Add(by_spread2, lost);
  // The height of the peak is scale · √precision.
  return {hn::Mul(grad_exponent, u), hn::NegMulAdd(scale, lost, hn::Mul(grad_exponent, inverse_scale))};
}

// Adds the contributions of each hit to its row, transposed four at a time.
HWY_INLINE void add_parts(const HitVec (&parts)[12], float* const* rows, size_t count) {
  const HitTag d;
  const hn::CappedTag<float, 4> four;
  HWY_ALIGN float quads[3][4 * hit_lanes];
  for (size_t q = 0; q < 3; ++q) {
    hn::StoreInterleaved4(parts[4 * q], parts[4 * q + 1], parts[4 * q + 2], parts[4 * q + 3], d, quads[q]);
  }
  for (size_t lane = 0; lane < count; ++lane) {
    float* HWY_RESTRICT row = rows[lane];
    for (size_t q = 0; q < 3; ++q) {
      for (size_t i = 0; i < 4; i += hn::Lanes(four)) {
        const auto sum = hn::Add(hn::LoadU(four, row + 4 * q + i), hn::LoadU(four, quads[q] + 4 * lane + i));
        hn::StoreU(sum, four, row + 4 * q + i);
      }
    }
  }
}

// Adds the contributions of each hit's geometry to the row of its surfel.
HWY_INLINE GradRay places_backward(const BackwardFrame* frames, const UnitRay& ray,
                                   const HitGradients& hits) {
  const HitTag d;
  const HitVec3 direction = spread(ray.direction), zero = spread(Vec3<float>(0));
  HitVec3 origin_sum = zero, direction_sum = zero;
  HitVec width_sum = hn::Zero(d);
  for (size_t i = 0; i < hits.count; i += hit_lanes) {
    const size_t count = std::min(hit_lanes, hits.count - i);
    const HitFrames f(frames, hits.surfel + i, count);
    const auto used = hn::FirstN(d, count);
    const HitVec distance = hn::IfThenElseZero(used, hn::LoadU(d, hits.distance + i));
    const HitVec grad_exponent = hn::IfThenElseZero(used, hn::LoadU(d, hits.grad_exponent + i));
    HitVec grad_distance = hn::IfThenElseZero(used, hn::LoadU(d, hits.grad_distance + i));
    const HitVec3 from_centre{hn::Sub(hn::Set(d, ray.origin.x), f.position.x),
                              hn::Sub(hn::Set(d, ray.origin.y), f.position.y),
                              hn::Sub(hn::Set(d, ray.origin.z), f.position.z)};
    const HitVec3 x = add_scaled(from_centre, distance, direction);
    const HitVec along_u = dot(f.t_u, x), along_v = dot(f.t_v, x);
    AxisGradient by_u, by_v;
    if (ray.width > 0) {
      const HitVec spread = hn::Mul(distance, hn::Set(d, ray.width));
      HitVec by_spread2 = hn::Zero(d);
      by_u = axis_gradient_widened(grad_exponent, along_u, f.inverse_scale_u, hn::Mul(spread, spread),
                                   by_spread2);
      by_v = axis_gradient_widened(grad_exponent, along_v, f.inverse_scale_v, hn::Mul(spread, spread),
                                   by_spread2);
      const HitVec by_spread = hn::IfThenElseZero(used, hn::Neg(hn::Mul(by_spread2, spread)));
      grad_distance = hn::MulAdd(by_spread, hn::Set(d, ray.width), grad_distance);
      width_sum = hn::MulAdd(by_spread, distance, width_sum);
    } else {
      by_u = axis_gradient(grad_exponent, along_u, f.inverse_scale_u);
      by_v = axis_gradient(grad_exponent, along_v, f.inverse_scale_v);
    }
    const HitVec grad_u = by_u.along, grad_v = by_v.along;
    const HitVec3 grad_x = add_scaled(add_scaled(zero, hn::Neg(grad_u), f.t_u), hn::Neg(grad_v), f.t_v);
    const HitVec a = hn::Div(hn::Add(grad_distance, dot(grad_x, direction)), dot(f.normal, direction));
    const HitVec half_distance = hn::Mul(hn::Set(d, 0.5F), distance);
    add_parts({grad_u, grad_v, a, hn::Mul(a, along_v), hn::Neg(hn::Mul(a, along_u)),
               hn::NegMulAdd(grad_u, along_v, hn::Mul(grad_v, along_u)), by_u.scale, by_v.scale,
               hn::Mul(grad_exponent, f.inverse_opacity), hn::Mul(half_distance, grad_u),
               hn::Mul(half_distance, grad_v), hn::Mul(half_distance, a)},
              hits.row + i, count);
    const HitVec3 moved = keep_lanes(used, add_scaled(grad_x, hn::Neg(a), f.normal));
    origin_sum = add_scaled(origin_sum, hn::Set(d, 1.0F), moved);
    direction_sum = add_scaled(direction_sum, distance, moved);
  }
  return {sum_lanes(origin_sum), sum_lanes(direction_sum), hn::GetLane(hn::SumOfLanes(d, width_sum))};
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif

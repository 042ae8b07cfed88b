// Intersects rays with disks: a vector of one with a single element of the other. Compiled once per target.
#if defined(TRACEFLOW_TRACE_DISK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_TRACE_DISK_INL_H
#undef TRACEFLOW_TRACE_DISK_INL_H
#else
#define TRACEFLOW_TRACE_DISK_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cmath>

#include "math/blend.h"
#include "ops/trace/cpu/tree-inl.h"
#include "ops/trace/trace_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace traceflow::trace::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The limits that decide whether a hit counts.
struct DiskRules {
  BlendRules<float> blend;
  float log_alpha_min;
  float near;
  bool has_cones;        // whether rays may have widths
  float deviations;      // cone_deviations()
  size_t hits_per_look;  // hits gathered between two checks of whether a ray has ended

  DiskRules(const Options& o, bool cones)
      : blend{o.alpha_min, o.alpha_max, o.transmittance_min},
        log_alpha_min(std::log(o.alpha_min)),
        near(o.t_min),
        has_cones(cones),
        deviations(cone_deviations(o)),
        hits_per_look(static_cast<size_t>(o.hits_per_pass)) {}
};

struct RayVec {
  Vec ox, oy, oz, dx, dy, dz;
  Vec width;
};

struct DiskHit {
  Vec distance, exponent;  // exponent: log of the opacity at the hit
  hn::Mask<Tag> mask;
};

HWY_INLINE Vec dot(Vec ax, Vec ay, Vec az, Vec bx, Vec by, Vec bz) {
  return hn::MulAdd(az, bz, hn::MulAdd(ay, by, hn::Mul(ax, bx)));
}

// load(row) returns a vector of one row of the leaf: several disks, or one disk in all lanes. The result of a
// lane is bitwise the same in both cases.
template <class LoadRow>
HWY_INLINE DiskHit intersect_disk(const RayVec& ray, const DiskRules& rules, Vec far, LoadRow&& load,
                                  const BvhLeaf& leaf) {
  const Tag d;
  const Vec qx = hn::Sub(ray.ox, load(leaf.position[0]));
  const Vec qy = hn::Sub(ray.oy, load(leaf.position[1]));
  const Vec qz = hn::Sub(ray.oz, load(leaf.position[2]));
  const Vec nx = load(leaf.normal[0]), ny = load(leaf.normal[1]), nz = load(leaf.normal[2]);
  const Vec t = hn::Neg(hn::Div(dot(nx, ny, nz, qx, qy, qz), dot(nx, ny, nz, ray.dx, ray.dy, ray.dz)));
  const Vec x = hn::MulAdd(t, ray.dx, qx), y = hn::MulAdd(t, ray.dy, qy), z = hn::MulAdd(t, ray.dz, qz);
  const Vec u = dot(load(leaf.u[0]), load(leaf.u[1]), load(leaf.u[2]), x, y, z);
  const Vec v = dot(load(leaf.v[0]), load(leaf.v[1]), load(leaf.v[2]), x, y, z);
  const Vec half = hn::Set(d, 0.5F);
  const Vec least = hn::Set(d, rules.log_alpha_min);
  Vec radius2 = hn::MulAdd(u, u, hn::Mul(v, v)), grown = hn::Set(d, 1.0F);
  if (rules.has_cones) {
    const Vec ux = load(leaf.u[0]), uy = load(leaf.u[1]), uz = load(leaf.u[2]);
    const Vec vx = load(leaf.v[0]), vy = load(leaf.v[1]), vz = load(leaf.v[2]);
    const Vec spread = hn::Mul(t, ray.width), spread2 = hn::Mul(spread, spread), one = hn::Set(d, 1.0F);
    // The growth factors of the disk's variances.
    const Vec grown_u = hn::MulAdd(spread2, dot(ux, uy, uz, ux, uy, uz), one);
    const Vec grown_v = hn::MulAdd(spread2, dot(vx, vy, vz, vx, vy, vz), one);
    radius2 = hn::Add(hn::Div(hn::Mul(u, u), grown_u), hn::Div(hn::Mul(v, v), grown_v));
    grown = hn::Mul(grown_u, grown_v);
  }
  Vec exponent = hn::NegMulAdd(radius2, half, load(leaf.log_opacity));
  auto mask = hn::And(hn::Ge(exponent, least), hn::And(hn::Ge(t, hn::Set(d, rules.near)), hn::Le(t, far)));
  // The peak is lower too. Most disks have failed already, so the logarithm is not computed for them.
  if (rules.has_cones && !hn::AllFalse(d, mask)) {
    exponent = hn::NegMulAdd(half, hn::Log(d, grown), exponent);
    mask = hn::And(mask, hn::Ge(exponent, least));
  }
  return {t, exponent, mask};
}

// Lanes without a hit have an arbitrary exponent, which is replaced by zero.
HWY_INLINE Vec disk_alpha(const DiskHit& hit, const DiskRules& rules) {
  const Tag d;
  const Vec exponent = hn::IfThenElseZero(hit.mask, hit.exponent);
  return hn::Min(hn::Exp(d, exponent), hn::Set(d, rules.blend.alpha_max));
}

}  // namespace traceflow::trace::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif

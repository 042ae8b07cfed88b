// The gradient of one hit (method §3.3 to §3.5), written once for a pixel per thread (`scalar`) and, compiled
// once per instruction set, for a vector of pixels. So there is no ordinary include guard.
#if defined(TRACEFLOW_RASTER_HIT_GRADIENT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TRACEFLOW_RASTER_HIT_GRADIENT_INL_H
#undef TRACEFLOW_RASTER_HIT_GRADIENT_INL_H
#else
#define TRACEFLOW_RASTER_HIT_GRADIENT_INL_H
#endif

#include "ops/raster/raster_kernels.h"

#undef TRACEFLOW_LANES_INLINE
#ifdef HWY_NAMESPACE
#define TRACEFLOW_LANES_INLINE HWY_INLINE
HWY_BEFORE_NAMESPACE();
namespace traceflow::raster::HWY_NAMESPACE {
#else
#define TRACEFLOW_LANES_INLINE TRACEFLOW_HD inline
namespace traceflow::raster::scalar {
#endif

// In both functions, l is the arithmetic on lanes (mul, add, …; at(x) for a value of the pixels; z(f, s) and
// inverse_z(f, s) of a hit), o the options, s the splat, f its footprint at the pixels with u = nu/w and v =
// nv/w, g dL/d(output) of the pixels, and saved what forward saved for them.

// dL/dw of a hit.
template <Asked asked, class L, class Footprint, class Grad, class Kept>
TRACEFLOW_LANES_INLINE auto grad_weight(const L& l, const KernelOptions& o, const Splat& s,
                                        const Footprint& f, const Grad& g, const Kept& saved) {
  auto own = l.at(g.constant);
  if constexpr (asked != Asked::colour) own = l.mul_add(l.z(f, s), l.at(g.z), own);
  for (int c = 0; c < 3; ++c) own = l.mul_add(l.set(s.colour[c]), l.at(g.colour[c]), own);
  own = l.mul_add(l.set(s.tint), l.at(g.tint), own);
  own = l.mul_add(l.set(s.in_body()), l.at(g.silhouette), own);
  own = l.mul_add(l.set(s.roughness()), l.at(g.roughness), own);
  if constexpr (asked != Asked::colour) {
    for (int c = 0; c < 3; ++c) own = l.mul_add(l.set(s.normal[c]), l.at(g.normal[c]), own);
  }
  if constexpr (asked == Asked::all) {
    // dL/dw_i = g (m² A + M2 - 2 m M1)
    const auto m = l.mul(l.set(o.m_scale), l.sub(l.at(saved.inverse_z), l.inverse_z(f, s)));
    const auto ma = l.neg_mul_add(m, l.at(saved.alpha), l.at(saved.m));  // M1 - m A
    own = l.mul_add(l.at(g.distortion), l.neg_mul_add(m, l.add(ma, l.at(saved.m)), l.at(saved.m2)), own);
  }
  return own;
}

// Adds a hit of this weight to the sums of its splat. grad_alpha: dL/dα. `hit` and `is_median`: the lanes
// whose pixel has the hit, and has it as its median; weight is zero in other lanes.
template <Asked asked, class L, class Footprint, class Grad, class Kept, class Value, class Mask>
TRACEFLOW_LANES_INLINE void add_hit(const L& l, const KernelOptions& o, const Splat& s, const Footprint& f,
                                    const Grad& g, const Kept& saved, Value weight, Value grad_alpha,
                                    Mask hit, Mask is_median, BasicSplatGradient<Value>& sums) {
  const auto z = l.z(f, s);
  auto grad_z = l.set(0.0F);
  if constexpr (asked != Asked::colour) grad_z = l.mul(weight, l.at(g.z));
  if constexpr (asked == Asked::all) {
    // dL/dm_i = 2 g w (m A - M1)
    const auto inverse_z = l.inverse_z(f, s);
    const auto scale = l.set(o.m_scale);
    const auto m = l.mul(scale, l.sub(l.at(saved.inverse_z), inverse_z));
    const auto ma = l.neg_mul_add(m, l.at(saved.alpha), l.at(saved.m));
    const auto slope = l.mul(scale, l.mul(inverse_z, inverse_z));
    grad_z = l.neg_mul_add(l.mul(l.mul(l.set(2.0F), l.at(g.distortion)), l.mul(weight, ma)), slope, grad_z);
    grad_z = l.add(grad_z, l.zero_unless(is_median, l.at(g.median)));
  }
  for (int c = 0; c < 3; ++c) sums.colour[c] = l.mul_add(weight, l.at(g.colour[c]), sums.colour[c]);
  sums.tint = l.mul_add(weight, l.at(g.tint), sums.tint);
  sums.roughness = l.mul_add(weight, l.at(g.roughness), sums.roughness);
  if constexpr (asked != Asked::colour) {
    for (int c = 0; c < 3; ++c) sums.normal[c] = l.mul_add(weight, l.at(g.normal[c]), sums.normal[c]);
  }

  // G = exp(-ρ/2): dL/dρ = -q/2 with q = o·G · dL/d(o·G), zero if α is clamped.
  const auto is_free = l.both(hit, l.less(f.opacity, l.set(o.alpha_max)));
  const auto q = l.zero_unless(is_free, l.mul(f.opacity, grad_alpha));
  sums.log_opacity = l.add(sums.log_opacity, q);

  const auto on_plane = l.both(hit, f.on_plane);
  if (l.may_hold(on_plane)) {
    // The hit in the plane: u = nu/w, v = nv/w, z = z_plane/w, ρ = u² + v².
    const auto inverse_w = l.zero_unless(on_plane, f.inverse_w);
    const auto u = l.mul(l.zero_unless(on_plane, f.nu), inverse_w);
    const auto v = l.mul(l.zero_unless(on_plane, f.nv), inverse_w);
    const auto qw = l.mul(l.zero_unless(on_plane, q), inverse_w);
    const auto grad_nu = l.neg(l.mul(qw, u));
    const auto grad_nv = l.neg(l.mul(qw, v));
    auto grad_w = l.mul(qw, l.mul_add(u, u, l.mul(v, v)));
    if constexpr (asked != Asked::colour) {
      const auto zw = l.mul(l.zero_unless(on_plane, grad_z), inverse_w);
      grad_w = l.neg_mul_add(zw, z, grad_w);
      sums.z_plane = l.add(zw, sums.z_plane);
    }
    sums.u_x = l.mul_add(grad_nu, f.x, sums.u_x);
    sums.u_y = l.mul_add(grad_nu, f.y, sums.u_y);
    sums.u_1 = l.add(grad_nu, sums.u_1);
    sums.v_x = l.mul_add(grad_nv, f.x, sums.v_x);
    sums.v_y = l.mul_add(grad_nv, f.y, sums.v_y);
    sums.v_1 = l.add(grad_nv, sums.v_1);
    sums.w_x = l.mul_add(grad_w, f.x, sums.w_x);
    sums.w_y = l.mul_add(grad_w, f.y, sums.w_y);
    sums.w_1 = l.add(grad_w, sums.w_1);
  }
  if (l.may_fail(on_plane)) {
    // The low-pass: ρ = rho_per_pixel2 (dx² + dy²).
    const auto by_centre = l.zero_if(on_plane, q);
    sums.centre_x = l.mul_add(by_centre, f.dx, sums.centre_x);
    sums.centre_y = l.mul_add(by_centre, f.dy, sums.centre_y);
    if constexpr (asked != Asked::colour) sums.z_centre = l.add(sums.z_centre, l.zero_if(on_plane, grad_z));
  }
}

#ifdef HWY_NAMESPACE
}  // namespace traceflow::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#else
}  // namespace traceflow::raster::scalar
#endif

#endif

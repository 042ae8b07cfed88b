#pragma once

#include <cmath>

#include "base/device.h"

// Blends a ray's hits front to back (method §3.3, §5.2), for the rasteriser and the tracer.
namespace traceflow {

// The limits of blending, from the Options of the op that blends.
template <class T>
struct BlendRules {
  T alpha_min;          // a hit with less opacity is skipped
  T alpha_max;          // a hit with more opacity is clamped to this
  T transmittance_min;  // the ray ends before a hit that would leave less than this
};

// α of one hit and dα/d(o·G). Both are zero for a skipped hit; the slope is zero for a clamped one.
template <class T>
struct BlendAlpha {
  T value;
  T slope;
};

template <class T>
TRACEFLOW_HD BlendAlpha<T> blend_alpha(const BlendRules<T>& rules, T opacity, T gaussian) {
  const T raw = opacity * gaussian;
  if (!(raw >= rules.alpha_min)) return {T(0), T(0)};
  if (raw >= rules.alpha_max) return {rules.alpha_max, T(0)};
  return {raw, T(1)};
}

// Returns whether the ray ends in front of a hit of this α, which is then not blended.
template <class T>
TRACEFLOW_HD bool blend_ends(const BlendRules<T>& rules, T transmittance, T alpha) {
  return transmittance * (T(1) - alpha) < rules.transmittance_min;
}

// dL/dα_i where w_i = α_i T_i: `own` is dL/dw_i, `behind` is Σ_{j>i} w_j dL/dw_j, `transmittance` is T_i.
template <class T>
TRACEFLOW_HD T blend_alpha_gradient(T transmittance, T alpha, T own, T behind) {
  return transmittance * own - behind / (T(1) - alpha);
}

// The squared distance from a surfel's centre, in standard deviations, at which o·G falls to alpha_min.
// Negative for a surfel that is skipped everywhere.
template <class T>
TRACEFLOW_HD T cutoff_radius2(const BlendRules<T>& rules, T opacity) {
  return opacity > T(0) ? T(2) * std::log(opacity / rules.alpha_min) : T(-1);
}

// The depth m = far/(far - near) · (1 - near/z) with which the distortion compares hits (method §3.5): 0 at
// the near plane and 1 at the far plane, as in 2DGS.
template <class T>
TRACEFLOW_HD T distortion_depth(T near_plane, T far_plane, T z) {
  return far_plane / (far_plane - near_plane) * (T(1) - near_plane / z);
}

// dm/dz
template <class T>
TRACEFLOW_HD T distortion_depth_slope(T near_plane, T far_plane, T z) {
  return far_plane * near_plane / ((far_plane - near_plane) * z * z);
}

}  // namespace traceflow

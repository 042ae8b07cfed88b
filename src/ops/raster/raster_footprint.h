#pragma once

#include <cmath>

#include "ops/raster/raster_kernels.h"

// Evaluates a splat at one pixel, for devices with one thread per pixel. The CPU's vector kernels do the same
// for many pixels (cpu/simd-inl.h). Several kernels must make the same decisions here: which tiles list a
// splat and which hits a pixel has. So every fused operation is explicit; otherwise the compiler could fuse
// differently at each place of inlining.
namespace traceflow::raster {

// The smaller (larger) of two numbers; the second if either is not a number.
TRACEFLOW_HD inline float lower(float a, float b) { return a < b ? a : b; }
TRACEFLOW_HD inline float higher(float a, float b) { return a > b ? a : b; }

// Method §3.1, §3.2. If `inside` is false, z is still finite, but u and v may be anything.
struct PixelFootprint {
  float x, y;       // pixels from the anchor
  float dx, dy;     // pixels from the projected centre
  float nu, nv, w;  // u = nu/w, v = nv/w
  float inverse_w;
  float opacity;  // o·G before the clamp
  bool on_plane;  // the hit in the plane wins over the low-pass
  bool inside;    // o·G ≥ alpha_min

  TRACEFLOW_HD float z(const Splat& s) const { return on_plane ? s.z_plane * inverse_w : s.z_centre; }
  TRACEFLOW_HD float inverse_z(const Splat& s) const {
    return on_plane ? s.inverse_z_plane * w : s.inverse_z_centre;
  }
};

// x, y: centre of the pixel. rho_per_pixel2: as in Saved.
TRACEFLOW_HD inline PixelFootprint footprint(const Splat& s, float x, float y, float rho_per_pixel2) {
  PixelFootprint f;
  f.x = x - s.anchor_x;
  f.y = y - s.anchor_y;
  f.w = std::fma(s.w_x, f.x, std::fma(s.w_y, f.y, s.w_1));
  f.inverse_w = 1.0F / f.w;
  f.nu = std::fma(s.u_x, f.x, std::fma(s.u_y, f.y, s.u_1));
  f.nv = std::fma(s.v_x, f.x, std::fma(s.v_y, f.y, s.v_1));
  f.dx = f.x - s.centre_x;
  f.dy = f.y - s.centre_y;
  const float rho_screen = rho_per_pixel2 * std::fma(f.dx, f.dx, f.dy * f.dy);
  const float rho_plane = std::fma(f.nu, f.nu, f.nv * f.nv) * (f.inverse_w * f.inverse_w);
  f.on_plane = f.w > 0.0F && f.w <= s.w_max && rho_plane <= lower(rho_screen, s.rho_max);
  const float rho = f.on_plane ? rho_plane : rho_screen;
  f.inside = rho <= s.rho_max;
  f.opacity = std::exp2(std::fma(rho, -0.72134752F, s.log2_opacity));
  return f;
}

// Returns whether a splat may cover a pixel centre in the rectangle [low_x, high_x] × [low_y, high_y]. Exact
// for the ellipse and the low-pass disk, up to a margin for rounding.
TRACEFLOW_HD inline bool reaches(const Splat& s, float low_x, float low_y, float high_x, float high_y,
                                 float rho_per_pixel2) {
  if (s.ellipse_x != s.ellipse_x) return true;
  constexpr float margin = 0.01F;
  low_x -= margin + s.anchor_x;
  low_y -= margin + s.anchor_y;
  high_x += margin - s.anchor_x;
  high_y += margin - s.anchor_y;
  const float rho = std::fma(s.rho_max, 1.002F, 0.02F);
  const auto clamp = [](float v, float low, float high) { return lower(higher(v, low), high); };
  const auto inside = [&](float x, float y) {
    const float nu = std::fma(s.u_x, x, std::fma(s.u_y, y, s.u_1));
    const float nv = std::fma(s.v_x, x, std::fma(s.v_y, y, s.v_1));
    const float w = std::fma(s.w_x, x, std::fma(s.w_y, y, s.w_1));
    return std::fma(nu, nu, nv * nv) <= rho * (w * w);
  };
  // In a rectangle, the minimum of the convex form is on the sides that face its centre.
  const float side_x = clamp(s.ellipse_x, low_x, high_x);
  const float side_y = clamp(s.ellipse_y, low_y, high_y);
  const float on_side_x = std::fma(s.slope_y, side_x - s.ellipse_x, s.ellipse_y);
  const float on_side_y = std::fma(s.slope_x, side_y - s.ellipse_y, s.ellipse_x);
  if (inside(side_x, clamp(on_side_x, low_y, high_y))) return true;
  if (inside(clamp(on_side_y, low_x, high_x), side_y)) return true;
  const float dx = clamp(s.centre_x, low_x, high_x) - s.centre_x;
  const float dy = clamp(s.centre_y, low_y, high_y) - s.centre_y;
  return rho_per_pixel2 * std::fma(dx, dx, dy * dy) <= rho;
}

}  // namespace traceflow::raster

#pragma once

#include <string>

#include "math/types.h"

// A capture's lens: maps directions in camera space to pixels of a stored photograph (method §2).
namespace traceflow {

// How an ideal lens maps a direction's angle θ to the optical axis, with tan θ = r = |(X/Z, Y/Z)|. The
// direction around the axis is unchanged.
enum class Projection {
  perspective,  // r
  equidistant,  // θ: the usual fisheye
  fov           // atan(2r·tan(ω/2)) / ω
};

// (u, v): the ideal projection of (X/Z, Y/Z). r² = u² + v²,
// k = (1 + k₁r² + k₂r⁴ + k₃r⁶ + k₄r⁸) / (1 + b₁r² + b₂r⁴ + b₃r⁶):
//   x' = u·k + 2p₁uv + p₂(r² + 2u²) + s₁r² + s₂r⁴
//   y' = v·k + 2p₂uv + p₁(r² + 2v²) + s₃r² + s₄r⁴
//   pixel = (f_x·x' + skew·y' + c_x,  f_y·y' + c_y)
struct Lens {
  double width = 0, height = 0;  // pixels
  Vec2<double> focal{1};         // pixels
  Vec2<double> centre{0};        // principal point, pixels; pixel (i, j) has its centre at (i + 0.5, j + 0.5)
  double skew = 0;               // pixels
  Vec3<double> radial{0};        // k₁, k₂, k₃
  Vec2<double> tangential{0};    // p₁, p₂
  double radial_4 = 0;           // k₄
  Vec3<double> radial_below{0};  // b₁, b₂, b₃
  Vec4<double> prism{0};         // s₁ to s₄
  Projection projection = Projection::perspective;
  double omega = 0;  // for fov; radians, in (0, π)

  // Without distortion or skew, so that no resampling is needed.
  bool is_pinhole() const;
  // The same lens for an image of another size.
  Lens resized(double new_width, double new_height) const;

  // From (X/Z, Y/Z) to (x', y').
  Vec2<double> distort(const Vec2<double>& ideal) const;
  // The Jacobian of distort: glm's columns are ∂/∂x and ∂/∂y.
  glm::dmat2 distort_jacobian(const Vec2<double>& ideal) const;
  // The inverse of distort by Newton's method. NaN if a fisheye's direction is 90° or more off the axis.
  Vec2<double> undistort(const Vec2<double>& distorted) const;
  Vec2<double> pixel_from_ideal(const Vec2<double>& ideal) const;
  Vec2<double> ideal_from_pixel(const Vec2<double>& pixel) const;
};

// Whether an image of one size can be stretched to the other: their proportions differ by at most 2 %.
bool same_proportions(double width, double height, double other_width, double other_height);

// The factor ≥ 1 on the focal length of an ideal pinhole, with the lens's principal point and size, that
// keeps each of its pixels within the photograph. What a fisheye sees beyond that pinhole is lost. Throws
// InputError with `origin` if the distortion folds the image over, if the zoom would exceed 2, or if the
// pinhole would see more than 80° off axis.
double pinhole_zoom(const Lens& lens, const std::string& origin);

}  // namespace traceflow

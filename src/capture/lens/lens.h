#pragma once

#include <string>

#include "math/types.h"

// A capture's lens: how directions in camera space fall on the pixels of a stored photograph (method §2).
namespace traceflow {

// What an ideal lens does with a direction's angle θ to the optical axis, tan θ = r = |(X/Z, Y/Z)|; the
// direction around the axis stays.
enum class Projection {
  perspective,  // r
  equidistant,  // θ: the common fisheye
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
  double omega = 0;  // of fov; radians, in (0, π)

  // Without distortion and skew: nothing has to be resampled.
  bool is_pinhole() const;
  // The same lens over an image of another size.
  Lens resized(double new_width, double new_height) const;

  // (X/Z, Y/Z) to (x', y').
  Vec2<double> distort(const Vec2<double>& ideal) const;
  // The derivative of distort: glm's columns are ∂/∂x and ∂/∂y.
  glm::dmat2 distort_jacobian(const Vec2<double>& ideal) const;
  // The inverse of distort by Newton's method. Not a number where a fisheye looks sideways or behind.
  Vec2<double> undistort(const Vec2<double>& distorted) const;
  Vec2<double> pixel_from_ideal(const Vec2<double>& ideal) const;
  Vec2<double> ideal_from_pixel(const Vec2<double>& pixel) const;
};

// Whether a picture of one size shows the same when it is stretched to the other: their proportions differ by
// 2 % at most.
bool same_proportions(double width, double height, double other_width, double other_height);

// The factor ≥ 1 by which the focal length of an ideal pinhole must exceed the lens's, principal point and
// size the same, so that each of its pixels lies within the photograph; what a fisheye sees beyond that
// pinhole is lost. Throws InputError naming `origin` when the distortion folds the image over, when more than
// a zoom of 2 were needed, and when the pinhole would see more than 80° off its axis.
double pinhole_zoom(const Lens& lens, const std::string& origin);

}  // namespace traceflow

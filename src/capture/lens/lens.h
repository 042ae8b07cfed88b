#pragma once

#include <string>

#include "math/types.h"

// A capture's lens: how directions in camera space fall on the pixels of a stored photograph (method §2).
namespace traceflow {

// x = X/Z, y = Y/Z, r² = x² + y², k = 1 + k₁r² + k₂r⁴ + k₃r⁶:
//   x' = x·k + 2p₁xy + p₂(r² + 2x²),   y' = y·k + 2p₂xy + p₁(r² + 2y²)
//   pixel = (f_x·x' + skew·y' + c_x,  f_y·y' + c_y)
struct Lens {
  double width = 0, height = 0;  // pixels
  Vec2<double> focal{1};         // pixels
  Vec2<double> centre{0};        // principal point, pixels; pixel (i, j) has its centre at (i + 0.5, j + 0.5)
  double skew = 0;               // pixels
  Vec3<double> radial{0};        // k₁, k₂, k₃
  Vec2<double> tangential{0};    // p₁, p₂

  // Without distortion and skew: nothing has to be resampled.
  bool is_pinhole() const;
  // The same lens over an image of another size.
  Lens resized(double new_width, double new_height) const;

  Vec2<double> distort(const Vec2<double>& ideal) const;
  // The inverse of distort by Newton's method.
  Vec2<double> undistort(const Vec2<double>& distorted) const;
  Vec2<double> pixel_from_ideal(const Vec2<double>& ideal) const;
  Vec2<double> ideal_from_pixel(const Vec2<double>& pixel) const;
};

// The factor ≥ 1 by which the focal length of an ideal pinhole must exceed the lens's, principal point and
// size the same, so that each of its pixels lies within the photograph. Throws InputError naming `origin`
// when the distortion folds the image over or more than a zoom of 2 were needed.
double pinhole_zoom(const Lens& lens, const std::string& origin);

}  // namespace traceflow

#pragma once

#include <array>
#include <cmath>

#include "base/device.h"

// Structural similarity of two images at one pixel (method §7.5), and its derivative.
namespace traceflow {

inline constexpr int ssim_radius = 5;

// The one-dimensional Gaussian window: 11 taps, σ 1.5, sum 1. The two-dimensional window is its product with
// itself.
inline std::array<double, 2 * ssim_radius + 1> ssim_window() {
  std::array<double, 2 * ssim_radius + 1> window{};
  double sum = 0;
  for (int k = -ssim_radius; k <= ssim_radius; ++k) {
    sum += window[k + ssim_radius] = std::exp(-k * k / (2 * 1.5 * 1.5));
  }
  for (double& tap : window) tap /= sum;
  return window;
}

// Windowed sums around a pixel, of x, y, x² + y² and x·y: all that SSIM needs.
template <class T>
struct SsimMoments {
  T mean_x, mean_y, squares, product;
};

// SSIM and its derivatives by the moments, except mean_y: the target is constant.
template <class T>
struct SsimDerivative {
  T value, by_mean_x, by_squares, by_product;
};

template <class T>
TRACEFLOW_HD TRACEFLOW_ALWAYS_INLINE SsimDerivative<T> ssim_with_derivative(const SsimMoments<T>& m) {
  constexpr T c1 = T(0.01 * 0.01), c2 = T(0.03 * 0.03);
  const T means = m.mean_x * m.mean_y;
  const T mean_squares = m.mean_x * m.mean_x + m.mean_y * m.mean_y;
  const T a1 = T(2) * means + c1, a2 = T(2) * (m.product - means) + c2;
  const T b1 = mean_squares + c1, b2 = m.squares - mean_squares + c2;
  const T inv = T(1) / (b1 * b2);
  const T value = a1 * a2 * inv;
  return {value, T(2) * inv * (m.mean_y * (a2 - a1) + m.mean_x * value * (b1 - b2)), -value * b1 * inv,
          T(2) * a1 * inv};
}

}  // namespace traceflow

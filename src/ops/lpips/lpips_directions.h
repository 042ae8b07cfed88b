#pragma once

#include <cmath>

#include "base/device.h"

// Compares two images' features at one pixel (method §8): Σ linear · (a/|a| − b/|b|)². Shared by the fast
// paths.
namespace traceflow::lpips {

// Added to the length by which a pixel's features are divided.
inline constexpr double length_epsilon = 1e-10;

// Both features divided by their lengths.
struct Directions {
  double length_a, inverse_a, inverse_b;

  TRACEFLOW_HD Directions(double squares_a, double squares_b)
      : length_a(std::sqrt(squares_a)),
        inverse_a(1 / (length_a + length_epsilon)),
        inverse_b(1 / (std::sqrt(squares_b) + length_epsilon)) {}
  TRACEFLOW_HD double difference(float a, float b) const {
    return static_cast<double>(a) * inverse_a - static_cast<double>(b) * inverse_b;
  }
};

// The gradient by a, times a scale: the longer a is, the less it changes its direction. along: Σ linear ·
// difference · a. Features of length zero have closed gates and need no gradient.
struct Bend {
  double outer, bend;

  TRACEFLOW_HD Bend(const Directions& d, double along, double scale)
      : outer(d.length_a > 0 ? 2 * scale * d.inverse_a : 0),
        bend(d.length_a > 0 ? along * d.inverse_a / d.length_a : 0) {}
  TRACEFLOW_HD float gradient(float linear, double difference, float a) const {
    return static_cast<float>(outer *
                              (static_cast<double>(linear) * difference - bend * static_cast<double>(a)));
  }
};

}  // namespace traceflow::lpips

#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "files/eight_bit.h"
#include "math/types.h"
#include "primitives/sums.h"

// Kernels of the metrics (method §8). Each returns the contribution of one pixel or number to the sum.
namespace traceflow::eval {

inline constexpr int64_t pixels_per_sum = 4096;
inline constexpr float least_alpha = 0.5F;  // below it nothing was rendered
inline constexpr float no_error = -1;

struct KeepSum {
  CountedSum* kept;
  TRACEFLOW_HD void operator()(const CountedSum& sum) const { *kept = sum; }
};

// mask null: every pixel counts.
TRACEFLOW_HD inline bool counts(const uint8_t* mask, int64_t pixel) {
  return mask == nullptr || mask[pixel] != 0;
}

struct BothMasks {
  const uint8_t *a, *b;
  uint8_t* both;

  TRACEFLOW_HD void operator()(int64_t i) const { both[i] = a[i] != 0 && b[i] != 0 ? 1 : 0; }
};

struct OtherMask {
  const uint8_t* mask;
  uint8_t* other;

  TRACEFLOW_HD void operator()(int64_t i) const { other[i] = mask[i] != 0 ? 0 : 1; }
};

struct RoundTo8Bit {
  const float* from;
  float* to;

  TRACEFLOW_HD void operator()(int64_t i) const { to[i] = from_8bit(to_8bit(from[i])); }
};

struct SquaredError {
  const float *image, *target;
  const uint8_t* mask;

  TRACEFLOW_HD CountedSum operator()(int64_t pixel) const {
    if (!counts(mask, pixel)) return {};
    const Vec3<double> difference = load3<double>(image + 3 * pixel) - load3<double>(target + 3 * pixel);
    return {dot(difference, difference), 3};
  }
};

// Angle between directions of any length; 90 if one has length zero.
TRACEFLOW_HD inline double angle_deg(const Vec3<double>& normal, const Vec3<double>& truth) {
  const double length = std::sqrt(dot(normal, normal) * dot(truth, truth));
  if (!(length > 0) || !std::isfinite(length)) return 90;
  // atan2 of sine and cosine is accurate for small angles; acos of a rounded cosine is not.
  const Vec3<double> sine = cross(normal, truth);
  return std::atan2(std::sqrt(dot(sine, sine)), dot(normal, truth)) * 180 / std::numbers::pi;
}

struct NormalError {
  const float *normal, *truth;
  const uint8_t* mask;

  TRACEFLOW_HD CountedSum operator()(int64_t pixel) const {
    const auto expected = load3<double>(truth + 3 * pixel);
    if (!counts(mask, pixel) || !(dot(expected, expected) > 0)) return {};
    return {angle_deg(load3<double>(normal + 3 * pixel), expected), 1};
  }
};

// alpha null: 1 everywhere.
struct DepthErrors {
  const float *depth, *alpha, *truth;
  double z_per_truth;
  float* errors;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const double expected = static_cast<double>(truth[i]) * z_per_truth;
    const bool is_rendered =
        depth[i] > 0 && std::isfinite(depth[i]) && (alpha == nullptr || alpha[i] >= least_alpha);
    errors[i] = !(expected > 0 && std::isfinite(expected)) ? no_error
                : is_rendered ? static_cast<float>(std::abs(static_cast<double>(depth[i]) / expected - 1))
                              : 1.0F;
  }
};

// Errors are not negative; negative values do not count.
struct MeanError {
  const float* errors;
  const uint8_t* mask;

  TRACEFLOW_HD CountedSum operator()(int64_t pixel) const {
    if (!counts(mask, pixel) || !(errors[pixel] >= 0)) return {};
    return {static_cast<double>(errors[pixel]), 1};
  }
};

}  // namespace traceflow::eval

#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "base/tensor.h"
#include "math/ssim.h"
#include "math/types.h"
#include "ops/loss/mean.h"
#include "primitives/sums.h"

// What the loss terms share, and their steps. Each step handles one pixel or number and returns what it adds
// to the sum.
namespace traceflow::loss {

inline constexpr int64_t block_pixels = 4096;

template <class T>
void check_same_shape(const Tensor<T>& a, const Tensor<T>& b, const Tensor<T>& gradient) {
  require(a.shape() == b.shape() && gradient.shape() == a.shape(),
          "image, target and gradient have one shape",
          a.shape().to_string() + ", " + b.shape().to_string() + ", " + gradient.shape().to_string());
}

template <class T>
void check_is_image(const Tensor<T>& image) {
  require(image.shape().rank() == 3 && image.dim(2) == 3, "an image has H×W×3 numbers",
          image.shape().to_string());
}

// −1, 0 or 1; 0 for NaN.
template <class T>
TRACEFLOW_HD T sign(T x) {
  return static_cast<T>(x > T(0)) - static_cast<T>(x < T(0));
}

template <class T>
TRACEFLOW_HD bool is_zero(const Vec3<T>& v) {
  return v == Vec3<T>(T(0));
}

// SSIM's window for the fast paths: the middle tap and the five beside it.
using HalfWindow = std::array<float, ssim_radius + 1>;
inline HalfWindow half_window() {
  const auto window = ssim_window();
  HalfWindow half{};
  for (size_t k = 0; k < half.size(); ++k) half[k] = static_cast<float>(window[ssim_radius + k]);
  return half;
}

// Turns a sum into a mean, over a known count or over the count found with the sum.
struct MeanOver {
  double count;
  Mean* mean;
  TRACEFLOW_HD void operator()(double sum) const { *mean = {count > 0 ? sum / count : 0, count}; }
};
struct MeanOverCounted {
  Mean* mean;
  TRACEFLOW_HD void operator()(const CountedSum& total) const {
    const auto count = static_cast<double>(total.count);
    *mean = {count > 0 ? total.sum / count : 0, count};
  }
};

struct L1 {
  const float *image, *target;
  float scale;
  float* gradient;

  TRACEFLOW_HD double operator()(int64_t i) const {
    const float difference = image[i] - target[i];
    gradient[i] += scale * sign(difference);
    return static_cast<double>(std::abs(difference));
  }
};

struct SquaredError {
  const float *image, *target;

  TRACEFLOW_HD double operator()(int64_t i) const {
    const double difference = static_cast<double>(image[i]) - static_cast<double>(target[i]);
    return difference * difference;
  }
};

// For one pixel.
struct KnownSquaredError {
  SquaredError error;
  const uint8_t* known;

  TRACEFLOW_HD CountedSum operator()(int64_t i) const {
    if (known[i] == 0) return {};
    return {error(3 * i) + error(3 * i + 1) + error(3 * i + 2), 3};
  }
};

struct Distortion {
  const float* map;
  float scale;
  float* gradient;

  TRACEFLOW_HD double operator()(int64_t i) const {
    gradient[i] += scale;
    return static_cast<double>(map[i]);
  }
};

// The Huber function x²/(2 width) up to |x| = width, and its derivative.
struct Huber {
  float width;

  TRACEFLOW_HD double operator()(float x) const {
    const float size = std::abs(x);
    return size < width ? static_cast<double>(x) * x / (2.0 * width)
                        : static_cast<double>(size) - 0.5 * width;
  }
  TRACEFLOW_HD float derivative(float x) const { return std::abs(x) < width ? x / width : sign(x); }
};

struct Silhouette {
  const float *silhouette, *mask;
  float scale;
  float* gradient;

  TRACEFLOW_HD double operator()(int64_t i) const {
    const Huber huber{0.1F};
    const float x = silhouette[i] - mask[i];
    gradient[i] += scale * huber.derivative(x);
    return huber(x);
  }
};

struct DepthPrior {
  const float *depth, *prior;
  float scale;
  float* gradient;

  TRACEFLOW_HD double operator()(int64_t i) const {
    if (!(prior[i] > 0) || depth[i] == 0) return 0;
    const Huber huber{0.05F};
    const float x = depth[i] / prior[i] - 1;
    gradient[i] += scale * huber.derivative(x) / prior[i];
    return huber(x);
  }
};

// For one row.
struct RowNorm {
  static constexpr float soft = 1e-3F;  // ε

  const float* rows;
  int64_t columns;
  float scale;
  float* gradient;

  TRACEFLOW_HD double operator()(int64_t i) const {
    const float* row = rows + i * columns;
    float squares = soft * soft;
    for (int64_t c = 0; c < columns; ++c) squares += row[c] * row[c];
    if (!std::isfinite(squares)) return 0;
    const float norm = std::sqrt(squares);
    for (int64_t c = 0; c < columns; ++c) gradient[i * columns + c] += scale * row[c] / norm;
    return static_cast<double>(norm) - soft;
  }
};

// Method §7.4, L_norm: compares a pixel's normal with the geometry around it.
template <class T>
struct NormalConsistency {
  const T *normal, *alpha, *pseudo;
  T scale;
  T *grad_normal, *grad_alpha, *grad_pseudo;

  TRACEFLOW_HD double operator()(int64_t i) const {
    const Vec3<T> n = load3<T>(normal + 3 * i), p = load3<T>(pseudo + 3 * i);
    if (is_zero(p)) return 0;
    const bool is_faint = alpha[i] < T(0.5);
    if (is_finite(n) && is_finite(p)) {
      if (is_faint) grad_alpha[i] += 2 * scale;
      add3(grad_normal + 3 * i, -scale * p);
      add3(grad_pseudo + 3 * i, -scale * n);
    }
    return (is_faint ? 2 * static_cast<double>(alpha[i]) : 1) - static_cast<double>(dot(n, p));
  }
};

// Method §7.4, L_tc-norm: compares a pixel's normal with the capture's prior.
template <class T>
struct NormalPrior {
  const T *normal, *prior;
  const T* tint;  // may be null
  T more;         // additional weight on a mirror

  TRACEFLOW_HD bool compared(const Vec3<T>& n, const Vec3<T>& p) const {
    return !is_zero(p) && dot(n, n) != T(0);
  }
  TRACEFLOW_HD T factor(int64_t i) const { return tint != nullptr ? 1 + more * tint[i] : T(1); }
  TRACEFLOW_HD CountedSum operator()(int64_t i) const {
    const Vec3<T> n = load3<T>(normal + 3 * i), p = load3<T>(prior + 3 * i);
    if (!compared(n, p)) return {};
    return {factor(i) * (1 - static_cast<double>(dot(n, p) / std::sqrt(dot(n, n)))), 1};
  }
};

// Runs after NormalPrior, whose mean has the number of compared pixels.
template <class T>
struct NormalPriorBackward {
  NormalPrior<T> forward;
  double weight;
  const Mean* mean;
  T* grad_normal;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const Vec3<T> n = load3<T>(forward.normal + 3 * i), p = load3<T>(forward.prior + 3 * i);
    if (!forward.compared(n, p)) return;
    const T scale = forward.factor(i) * static_cast<T>(weight / mean->count);
    const T inv_length = T(1) / std::sqrt(dot(n, n));
    const Vec3<T> unit = n * inv_length;
    const Vec3<T> gradient = -scale * inv_length * (p - dot(unit, p) * unit);
    if (is_finite(gradient)) add3(grad_normal + 3 * i, gradient);
  }
};

}  // namespace traceflow::loss

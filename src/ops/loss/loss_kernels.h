#pragma once

#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "base/tensor.h"
#include "math/types.h"

// What the loss terms share.
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

// −1, 0 or 1; 0 for what is not a number.
template <class T>
T sign(T x) {
  return static_cast<T>(x > T(0)) - static_cast<T>(x < T(0));
}

template <class T>
bool is_zero(const Vec3<T>& v) {
  return v == Vec3<T>(T(0));
}

template <class T>
bool is_finite(const Vec3<T>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// A sum over some of the pixels and their number.
struct CountedSum {
  double sum = 0;
  int64_t count = 0;
  CountedSum& operator+=(const CountedSum& other) {
    sum += other.sum;
    count += other.count;
    return *this;
  }
};

// Method §7.4, L_norm: a pixel is compared with the geometry around it.
template <class T>
double mean_normal_consistency(const Tensor<T>& normal, const Tensor<T>& pseudo, double weight,
                               Tensor<T>& grad_normal, Tensor<T>& grad_pseudo) {
  check_is_image(normal);
  check_same_shape(normal, pseudo, grad_normal);
  check_same_shape(normal, pseudo, grad_pseudo);
  const int64_t pixels = normal.size() / 3;
  if (pixels == 0) return 0;
  const T scale = static_cast<T>(weight / static_cast<double>(pixels));
  const double sum = ordered_sum<double>(
      "loss: normal consistency", pixels,
      [&](int64_t i) -> double {
        const Vec3<T> n = load3<T>(normal.data() + 3 * i), p = load3<T>(pseudo.data() + 3 * i);
        if (is_zero(p)) return 0;
        if (is_finite(n) && is_finite(p)) {
          add3(grad_normal.data() + 3 * i, -scale * p);
          add3(grad_pseudo.data() + 3 * i, -scale * n);
        }
        return 1 - static_cast<double>(dot(n, p));
      },
      block_pixels);
  return sum / static_cast<double>(pixels);
}

// Method §7.4, L_tc-norm: a pixel is compared with the capture's prior.
template <class T>
double mean_normal_prior(const Tensor<T>& normal, const Tensor<T>& prior, double weight,
                         Tensor<T>& grad_normal) {
  check_is_image(normal);
  check_same_shape(normal, prior, grad_normal);
  const int64_t pixels = normal.size() / 3;
  const auto compared = [&](int64_t i) {
    const Vec3<T> n = load3<T>(normal.data() + 3 * i);
    return !is_zero(load3<T>(prior.data() + 3 * i)) && dot(n, n) != T(0);
  };
  const CountedSum total = ordered_sum<CountedSum>(
      "loss: normal prior", pixels,
      [&](int64_t i) -> CountedSum {
        if (!compared(i)) return {};
        const Vec3<T> n = load3<T>(normal.data() + 3 * i), p = load3<T>(prior.data() + 3 * i);
        return {1 - static_cast<double>(dot(n, p) / std::sqrt(dot(n, n))), 1};
      },
      block_pixels);
  if (total.count == 0) return 0;
  const T scale = static_cast<T>(weight / static_cast<double>(total.count));
  parallel_for(
      "loss: normal prior backward", pixels,
      [&](int64_t i) {
        if (!compared(i)) return;
        const Vec3<T> n = load3<T>(normal.data() + 3 * i), p = load3<T>(prior.data() + 3 * i);
        const T inv_length = T(1) / std::sqrt(dot(n, n));
        const Vec3<T> unit = n * inv_length;
        const Vec3<T> gradient = -scale * inv_length * (p - dot(unit, p) * unit);
        if (is_finite(gradient)) add3(grad_normal.data() + 3 * i, gradient);
      },
      block_pixels);
  return total.sum / static_cast<double>(total.count);
}

}  // namespace traceflow::loss

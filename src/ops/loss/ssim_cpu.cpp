#include <array>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "math/ssim.h"
#include "ops/loss/loss.h"
#include "ops/loss/loss_kernels.h"
#include "ops/loss/ssim_cuda.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/loss/ssim_cpu.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// SSIM by rows. The window is separable: each row of a map is first summed over the eleven rows around it
// into a row buffer, with products formed on the way, and then along the buffer. An image's three channels
// stay interleaved, so the next pixel of a channel is three numbers further. Taps are used in pairs about the
// middle. In the backward pass, the adjoint of a symmetric window with zero padding is the window itself: the
// three derivative maps pass through the same two sums.

#ifndef TRACEFLOW_OPS_LOSS_SSIM_CPU_ONCE
#define TRACEFLOW_OPS_LOSS_SSIM_CPU_ONCE
namespace traceflow::loss {

inline constexpr int64_t taps = 2 * ssim_radius + 1;
inline constexpr int64_t channels = 3;
// Zeros on either side of a row buffer: at least ssim_radius pixels, and whole cache lines.
inline constexpr int64_t row_padding = 16;
static_assert(row_padding >= ssim_radius * channels);

// A row and its neighbours, from ssim_radius above to ssim_radius below.
using Rows = std::array<const float*, taps>;

// Row buffers or row pointers of the four moments, and of the value and the three derivatives.
struct MomentRows {
  float *mean_x, *mean_y, *squares, *product;
};
struct DerivativeRows {
  float *value, *by_mean_x, *by_squares, *by_product;
};

}  // namespace traceflow::loss
#endif

HWY_BEFORE_NAMESPACE();
namespace traceflow::loss::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Wide = hn::ScalableTag<float>;
using Single = hn::CappedTag<float, 1>;

// One vector of the moments, summed over the window's rows.
template <class D>
HWY_INLINE void sum_columns_of_moments_at(D d, const Rows& x, const Rows& y, const HalfWindow& window,
                                          int64_t i, const MomentRows& out) {
  const auto x0 = hn::LoadU(d, x[ssim_radius] + i), y0 = hn::LoadU(d, y[ssim_radius] + i);
  const auto w0 = hn::Set(d, window[0]);
  auto mean_x = hn::Mul(w0, x0), mean_y = hn::Mul(w0, y0);
  auto squares = hn::Mul(w0, hn::MulAdd(x0, x0, hn::Mul(y0, y0)));
  auto product = hn::Mul(w0, hn::Mul(x0, y0));
  for (int k = 1; k <= ssim_radius; ++k) {
    const auto w = hn::Set(d, window[k]);
    const auto xa = hn::LoadU(d, x[ssim_radius - k] + i), xb = hn::LoadU(d, x[ssim_radius + k] + i);
    const auto ya = hn::LoadU(d, y[ssim_radius - k] + i), yb = hn::LoadU(d, y[ssim_radius + k] + i);
    mean_x = hn::MulAdd(w, hn::Add(xa, xb), mean_x);
    mean_y = hn::MulAdd(w, hn::Add(ya, yb), mean_y);
    const auto squares_a = hn::MulAdd(xa, xa, hn::Mul(ya, ya));
    const auto squares_ab = hn::MulAdd(xb, xb, hn::MulAdd(yb, yb, squares_a));
    squares = hn::MulAdd(w, squares_ab, squares);
    product = hn::MulAdd(w, hn::MulAdd(xa, ya, hn::Mul(xb, yb)), product);
  }
  hn::StoreU(mean_x, d, out.mean_x + i);
  hn::StoreU(mean_y, d, out.mean_y + i);
  hn::StoreU(squares, d, out.squares + i);
  hn::StoreU(product, d, out.product + i);
}

void sum_columns_of_moments(const Rows& x, const Rows& y, const HalfWindow& window, int64_t n,
                            const MomentRows& out) {
  const Wide d;
  const auto lanes = static_cast<int64_t>(hn::Lanes(d));
  int64_t i = 0;
  for (; i + lanes <= n; i += lanes) sum_columns_of_moments_at(d, x, y, window, i, out);
  for (; i < n; ++i) sum_columns_of_moments_at(Single(), x, y, window, i, out);
}

// The middle element has the weight window[0]; those at distance k on either side are at a(k) and b(k).
template <class D, class Above, class Below>
HWY_INLINE hn::Vec<D> windowed(D d, const HalfWindow& window, const float* middle, Above a, Below b) {
  auto sum = hn::Mul(hn::Set(d, window[0]), hn::LoadU(d, middle));
  for (int k = 1; k <= ssim_radius; ++k) {
    sum = hn::MulAdd(hn::Set(d, window[k]), hn::Add(hn::LoadU(d, a(k)), hn::LoadU(d, b(k))), sum);
  }
  return sum;
}

template <class D>
HWY_INLINE void sum_column_at(D d, const Rows& rows, const HalfWindow& window, int64_t i, float* out) {
  const auto sum = windowed(
      d, window, rows[ssim_radius] + i, [&](int k) { return rows[ssim_radius - k] + i; },
      [&](int k) { return rows[ssim_radius + k] + i; });
  hn::StoreU(sum, d, out + i);
}

void sum_columns(const Rows& rows, const HalfWindow& window, int64_t n, float* out) {
  const Wide d;
  const auto lanes = static_cast<int64_t>(hn::Lanes(d));
  int64_t i = 0;
  for (; i + lanes <= n; i += lanes) sum_column_at(d, rows, window, i, out);
  for (; i < n; ++i) sum_column_at(Single(), rows, window, i, out);
}

template <class D>
HWY_INLINE void sum_row_at(D d, const float* row, const HalfWindow& window, int64_t i, float* out) {
  const auto sum = windowed(
      d, window, row + i, [&](int k) { return row + i - k * channels; },
      [&](int k) { return row + i + k * channels; });
  hn::StoreU(sum, d, out + i);
}

// `row` has row_padding zeros on either side.
void sum_along(const float* row, const HalfWindow& window, int64_t n, float* out) {
  const Wide d;
  const auto lanes = static_cast<int64_t>(hn::Lanes(d));
  int64_t i = 0;
  for (; i + lanes <= n; i += lanes) sum_row_at(d, row, window, i, out);
  for (; i < n; ++i) sum_row_at(Single(), row, window, i, out);
}

HWY_INLINE float finite_or_zero(float v) {
  return std::abs(v) <= std::numeric_limits<float>::max() ? v : 0.0F;
}

// The compiler vectorises this function and the next for the target. Values that are not finite have no
// derivative.
void compare_row(const MomentRows& m, int64_t n, const DerivativeRows& out) {
#pragma omp simd
  for (int64_t i = 0; i < n; ++i) {
    const auto d = ssim_with_derivative<float>({m.mean_x[i], m.mean_y[i], m.squares[i], m.product[i]});
    out.value[i] = d.value;
    out.by_mean_x[i] = finite_or_zero(d.by_mean_x);
    out.by_squares[i] = finite_or_zero(d.by_squares);
    out.by_product[i] = finite_or_zero(d.by_product);
  }
}

// d: the three derivatives, summed over the window.
void add_gradient_row(const DerivativeRows& d, const float* x, const float* y, float scale, int64_t n,
                      float* gradient) {
#pragma omp simd
  for (int64_t i = 0; i < n; ++i) {
    gradient[i] +=
        finite_or_zero(scale * (d.by_mean_x[i] + 2 * x[i] * d.by_squares[i] + y[i] * d.by_product[i]));
  }
}

}  // namespace traceflow::loss::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::loss {

namespace {

HWY_EXPORT(sum_columns_of_moments);
HWY_EXPORT(sum_columns);
HWY_EXPORT(sum_along);
HWY_EXPORT(compare_row);
HWY_EXPORT(add_gradient_row);

constexpr int64_t rows_per_block = 8;

// Rows of n numbers, each with zeros on either side.
class PaddedRows {
 public:
  PaddedRows(int64_t count, int64_t n)
      : stride_((n + 2 * row_padding + 15) / 16 * 16), values_(static_cast<size_t>(count * stride_), 0.0F) {}
  float* operator()(int64_t i) { return values_.data() + i * stride_ + row_padding; }

 private:
  int64_t stride_;
  std::vector<float> values_;
};

// A row of the map and its neighbours; rows outside the map are zeros.
Rows rows_around(const Tensor<float>& map, int64_t row, const float* zeros) {
  Rows rows{};
  for (int64_t k = 0; k < taps; ++k) {
    const int64_t at = row + k - ssim_radius;
    rows[static_cast<size_t>(k)] = at >= 0 && at < map.dim(0) ? map.row(at) : zeros;
  }
  return rows;
}

// Working memory of one block; computes the SSIM of one row at a time.
class RowComparison {
 public:
  RowComparison(const Tensor<float>& image, const Tensor<float>& target)
      : image_(image),
        target_(target),
        n_(image.row_size()),
        summed_down_(4, n_),
        summed_(4, n_),
        zeros_(1, n_) {}

  void operator()(int64_t row, const HalfWindow& window, const DerivativeRows& out) {
    const MomentRows down{summed_down_(0), summed_down_(1), summed_down_(2), summed_down_(3)};
    const MomentRows moments{summed_(0), summed_(1), summed_(2), summed_(3)};
    HWY_DYNAMIC_DISPATCH(sum_columns_of_moments)
    (rows_around(image_, row, zeros_(0)), rows_around(target_, row, zeros_(0)), window, n_, down);
    for (int64_t k = 0; k < 4; ++k) HWY_DYNAMIC_DISPATCH(sum_along)(summed_down_(k), window, n_, summed_(k));
    HWY_DYNAMIC_DISPATCH(compare_row)(moments, n_, out);
  }

 private:
  const Tensor<float>& image_;
  const Tensor<float>& target_;
  int64_t n_;
  PaddedRows summed_down_, summed_, zeros_;
};

// Eight parallel sums, so that none waits for another.
double sum_of(const float* values, int64_t n) {
  constexpr int64_t lanes = 8;
  std::array<double, lanes> sums{};
  int64_t i = 0;
  for (; i + lanes <= n; i += lanes) {
    for (int64_t lane = 0; lane < lanes; ++lane) {
      sums[static_cast<size_t>(lane)] += static_cast<double>(values[i + lane]);
    }
  }
  for (; i < n; ++i) sums[0] += static_cast<double>(values[i]);
  double sum = 0;
  for (const double s : sums) sum += s;
  return sum;
}

// Derivatives of every pixel's SSIM by its moments, each H×W×3.
struct DerivativeMaps {
  Tensor<float> by_mean_x, by_squares, by_product;
};

// Fills the maps and returns Σ SSIM.
double compare_images(const Tensor<float>& image, const Tensor<float>& target, const HalfWindow& window,
                      DerivativeMaps& maps) {
  const int64_t height = image.dim(0), n = image.row_size();
  for (Tensor<float>* map : {&maps.by_mean_x, &maps.by_squares, &maps.by_product}) map->resize(image.shape());
  std::vector<double> row_sum(static_cast<size_t>(height));
  parallel_blocks("loss: ssim", height, rows_per_block, [&](int64_t begin, int64_t end) {
    RowComparison compare(image, target);
    std::vector<float> value(static_cast<size_t>(n));
    for (int64_t row = begin; row < end; ++row) {
      compare(row, window,
              {value.data(), maps.by_mean_x.row(row), maps.by_squares.row(row), maps.by_product.row(row)});
      row_sum[static_cast<size_t>(row)] = sum_of(value.data(), n);
    }
  });
  double sum = 0;
  for (const double s : row_sum) sum += s;
  return sum;
}

void add_gradient(const Tensor<float>& image, const Tensor<float>& target, const HalfWindow& window,
                  const DerivativeMaps& maps, float scale, Tensor<float>& gradient) {
  const int64_t n = image.row_size();
  parallel_blocks("loss: ssim backward", image.dim(0), rows_per_block, [&](int64_t begin, int64_t end) {
    PaddedRows down(1, n), zeros(1, n), summed(3, n);
    for (int64_t row = begin; row < end; ++row) {
      int64_t k = 0;
      for (const Tensor<float>* map : {&maps.by_mean_x, &maps.by_squares, &maps.by_product}) {
        HWY_DYNAMIC_DISPATCH(sum_columns)(rows_around(*map, row, zeros(0)), window, n, down(0));
        HWY_DYNAMIC_DISPATCH(sum_along)(down(0), window, n, summed(k++));
      }
      HWY_DYNAMIC_DISPATCH(add_gradient_row)
      ({nullptr, summed(0), summed(1), summed(2)}, image.row(row), target.row(row), scale, n,
       gradient.row(row));
    }
  });
}

}  // namespace

void ssim_loss(const Tensor<float>& image, const Tensor<float>& target, double weight,
               Tensor<float>& grad_image, const MeanSlot& value) {
  check_same_shape(image, target, grad_image);
  check_is_image(image);
  Mean* const mean = value.on(image.device());
  const HalfWindow window = half_window();
  if (image.device() == Device::cuda) {
    cuda::ssim_loss(image, target, window, weight, grad_image, mean);
    return;
  }
  *mean = {0, 0};
  if (image.empty()) return;
  const auto count = static_cast<double>(image.size());
  static thread_local DerivativeMaps maps;  // kept between calls, so that an iteration allocates no new pages
  const double sum = compare_images(image, target, window, maps);
  add_gradient(image, target, window, maps, static_cast<float>(-weight / count), grad_image);
  *mean = {1 - sum / count, count};
}

double ssim(const Tensor<float>& image, const Tensor<float>& target, const Tensor<uint8_t>& mask) {
  check_same_shape(image, target, image);
  check_is_image(image);
  require(mask.empty() || mask.size() * channels == image.size(), "the mask has the image's size",
          mask.shape().to_string());
  const HalfWindow window = half_window();
  if (image.device() == Device::cuda) {
    Tensor<Mean> found({1}, Device::cuda);
    cuda::ssim(image, target, window, mask.empty() ? nullptr : mask.data(), found.data());
    const Mean mean = found.on(Device::cpu)[0];
    return mean.count > 0 ? mean.value : std::numeric_limits<double>::quiet_NaN();
  }
  const int64_t n = image.row_size();
  const auto masked_sum = [&](const float* value, int64_t row) {
    CountedSum total;
    for (int64_t i = 0; i < n; ++i) {
      if (mask.empty() || mask[(row * n + i) / channels] != 0) total += {static_cast<double>(value[i]), 1};
    }
    return total;
  };
  std::vector<CountedSum> row_sum(static_cast<size_t>(image.dim(0)));
  parallel_blocks("loss: ssim metric", image.dim(0), rows_per_block, [&](int64_t begin, int64_t end) {
    RowComparison compare(image, target);
    PaddedRows out(4, n);
    for (int64_t row = begin; row < end; ++row) {
      compare(row, window, {out(0), out(1), out(2), out(3)});
      row_sum[static_cast<size_t>(row)] = masked_sum(out(0), row);
    }
  });
  CountedSum total;
  for (const CountedSum& s : row_sum) total += s;
  return total.count == 0 ? std::numeric_limits<double>::quiet_NaN()
                          : total.sum / static_cast<double>(total.count);
}

}  // namespace traceflow::loss
#endif

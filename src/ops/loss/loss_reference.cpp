#include <cmath>

#include "math/ssim.h"
#include "ops/loss/loss.h"
#include "ops/loss/normal_terms.h"

// The reference in double precision: direct sums over the two-dimensional window.
namespace traceflow::loss {

namespace {

struct Pixel {
  int64_t row, column, channel;
};

// Calls f(weight, neighbour) for the neighbours of a pixel that are within the window and in the image.
template <class F>
void over_window(const Tensor<double>& image, const Pixel& centre, F&& f) {
  static const auto window = ssim_window();
  for (int dy = -ssim_radius; dy <= ssim_radius; ++dy) {
    for (int dx = -ssim_radius; dx <= ssim_radius; ++dx) {
      const int64_t row = centre.row + dy, column = centre.column + dx;
      if (row < 0 || row >= image.dim(0) || column < 0 || column >= image.dim(1)) continue;
      f(window[dy + ssim_radius] * window[dx + ssim_radius], Pixel{row, column, centre.channel});
    }
  }
}

double at(const Tensor<double>& image, const Pixel& p) { return image(p.row, p.column, p.channel); }

SsimMoments<double> moments_at(const Tensor<double>& image, const Tensor<double>& target,
                               const Pixel& centre) {
  SsimMoments<double> m{};
  over_window(image, centre, [&](double weight, const Pixel& p) {
    const double x = at(image, p), y = at(target, p);
    m.mean_x += weight * x;
    m.mean_y += weight * y;
    m.squares += weight * (x * x + y * y);
    m.product += weight * x * y;
  });
  return m;
}

}  // namespace

double l1_reference(const Tensor<double>& image, const Tensor<double>& target, double weight,
                    Tensor<double>& grad_image) {
  check_same_shape(image, target, grad_image);
  if (image.empty()) return 0;
  const auto count = static_cast<double>(image.size());
  double sum = 0;
  for (int64_t i = 0; i < image.size(); ++i) {
    const double difference = image[i] - target[i];
    sum += std::abs(difference);
    grad_image[i] += weight / count * sign(difference);
  }
  return sum / count;
}

double ssim_loss_reference(const Tensor<double>& image, const Tensor<double>& target, double weight,
                           Tensor<double>& grad_image) {
  check_same_shape(image, target, grad_image);
  check_is_image(image);
  if (image.empty()) return 0;
  const auto count = static_cast<double>(image.size());
  double sum = 0;
  for (int64_t row = 0; row < image.dim(0); ++row) {
    for (int64_t column = 0; column < image.dim(1); ++column) {
      for (int64_t channel = 0; channel < image.dim(2); ++channel) {
        const Pixel centre{row, column, channel};
        const SsimDerivative<double> d = ssim_with_derivative(moments_at(image, target, centre));
        sum += 1 - d.value;
        over_window(image, centre, [&](double tap, const Pixel& p) {
          grad_image(p.row, p.column, p.channel) -=
              weight / count * tap *
              (d.by_mean_x + 2 * at(image, p) * d.by_squares + at(target, p) * d.by_product);
        });
      }
    }
  }
  return sum / count;
}

double silhouette_reference(const Tensor<double>& silhouette, const Tensor<double>& mask, double weight,
                            Tensor<double>& grad_silhouette) {
  constexpr double width = 0.1;
  const auto count = static_cast<double>(silhouette.size());
  double sum = 0;
  for (int64_t i = 0; i < silhouette.size(); ++i) {
    const double x = silhouette[i] - mask[i];
    sum += std::abs(x) < width ? x * x / (2 * width) : std::abs(x) - width / 2;
    grad_silhouette[i] += weight / count * std::clamp(x / width, -1.0, 1.0);
  }
  return count > 0 ? sum / count : 0;
}

double depth_prior_reference(const Tensor<double>& depth, const Tensor<double>& prior, double weight,
                             Tensor<double>& grad_depth) {
  constexpr double width = 0.05;
  const auto count = static_cast<double>(depth.size());
  double sum = 0;
  for (int64_t i = 0; i < depth.size(); ++i) {
    if (prior[i] == 0 || depth[i] == 0) continue;
    const double x = (depth[i] - prior[i]) / prior[i];
    sum += std::abs(x) < width ? x * x / (2 * width) : std::abs(x) - width / 2;
    grad_depth[i] += weight / count * std::clamp(x / width, -1.0, 1.0) / prior[i];
  }
  return count > 0 ? sum / count : 0;
}

double row_norm_reference(const Tensor<double>& rows, double weight, Tensor<double>& grad_rows) {
  constexpr double soft = 1e-3;
  const auto count = static_cast<double>(rows.dim(0));
  double sum = 0;
  for (int64_t i = 0; i < rows.dim(0); ++i) {
    double squares = 0;
    for (int64_t c = 0; c < rows.row_size(); ++c) squares += rows(i, c) * rows(i, c);
    const double norm = std::sqrt(squares + soft * soft);
    if (!std::isfinite(norm)) continue;
    sum += norm - soft;
    for (int64_t c = 0; c < rows.row_size(); ++c) grad_rows(i, c) += weight / count * rows(i, c) / norm;
  }
  return count > 0 ? sum / count : 0;
}

double normal_consistency_reference(const Tensor<double>& normal, const Tensor<double>& alpha,
                                    const Tensor<double>& pseudo, double weight, Tensor<double>& grad_normal,
                                    Tensor<double>& grad_alpha, Tensor<double>& grad_pseudo) {
  Mean mean{};
  mean_normal_consistency(normal, alpha, pseudo, weight, grad_normal, grad_alpha, grad_pseudo, &mean);
  return mean.value;
}

double normal_prior_reference(const Tensor<double>& normal, const Tensor<double>& prior,
                              const Tensor<double>& tint, double on_mirrors, double weight,
                              Tensor<double>& grad_normal) {
  Mean mean{};
  mean_normal_prior(normal, prior, tint, on_mirrors, weight, grad_normal, &mean);
  return mean.value;
}

}  // namespace traceflow::loss

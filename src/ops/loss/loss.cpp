#include <array>
#include <vector>

#include "ops/loss/loss.h"
#include "ops/loss/normal_terms.h"

namespace traceflow::loss {

namespace {

// Σ |x − y| over a block, and its gradient. Sixteen parallel sums, so that the compiler may use wide
// registers without changing the order of any sum.
double l1_block(const float* x, const float* y, int64_t n, float scale, float* gradient) {
  constexpr int64_t lanes = 16;
  std::array<float, lanes> sums{};
  int64_t i = 0;
  for (; i + lanes <= n; i += lanes) {
    for (int64_t lane = 0; lane < lanes; ++lane) {
      const float difference = x[i + lane] - y[i + lane];
      sums[static_cast<size_t>(lane)] += std::abs(difference);
      gradient[i + lane] += scale * sign(difference);
    }
  }
  double total = 0;
  for (; i < n; ++i) {
    total += std::abs(x[i] - y[i]);
    gradient[i] += scale * sign(x[i] - y[i]);
  }
  for (const float sum : sums) total += sum;
  return total;
}

double l1_sum(const Tensor<float>& image, const Tensor<float>& target, float scale,
              Tensor<float>& grad_image) {
  std::vector<double> partial(static_cast<size_t>((image.size() + block_pixels - 1) / block_pixels));
  parallel_blocks("loss: l1", image.size(), block_pixels, [&](int64_t begin, int64_t end) {
    partial[static_cast<size_t>(begin / block_pixels)] =
        l1_block(image.data() + begin, target.data() + begin, end - begin, scale, grad_image.data() + begin);
  });
  double sum = 0;
  for (const double p : partial) sum += p;
  return sum;
}

}  // namespace

void l1(const Tensor<float>& image, const Tensor<float>& target, double weight, Tensor<float>& grad_image,
        const MeanSlot& value) {
  check_same_shape(image, target, grad_image);
  const auto count = static_cast<double>(image.size());
  const auto scale = static_cast<float>(weight / count);
  const MeanOver mean{count, value.on(image.device())};
  if (image.device() == Device::cuda) {
    ordered_sum<double>(Device::cuda, "loss: l1", image.size(),
                        L1{image.data(), target.data(), scale, grad_image.data()}, mean, block_pixels);
    return;
  }
  mean(l1_sum(image, target, scale, grad_image));
}

void normal_consistency(const Tensor<float>& normal, const Tensor<float>& alpha, const Tensor<float>& pseudo,
                        double weight, Tensor<float>& grad_normal, Tensor<float>& grad_alpha,
                        Tensor<float>& grad_pseudo, const MeanSlot& value) {
  mean_normal_consistency(normal, alpha, pseudo, weight, grad_normal, grad_alpha, grad_pseudo,
                          value.on(normal.device()));
}

void normal_prior(const Tensor<float>& normal, const Tensor<float>& prior, const Tensor<float>& tint,
                  double on_mirrors, double weight, Tensor<float>& grad_normal, const MeanSlot& value) {
  mean_normal_prior(normal, prior, tint, on_mirrors, weight, grad_normal, value.on(normal.device()));
}

void distortion(const Tensor<float>& distortion_map, double weight, Tensor<float>& grad_distortion,
                const MeanSlot& value) {
  check_same_shape(distortion_map, distortion_map, grad_distortion);
  const auto count = static_cast<double>(distortion_map.size());
  const Distortion step{distortion_map.data(), static_cast<float>(weight / count), grad_distortion.data()};
  ordered_sum<double>(distortion_map.device(), "loss: distortion", distortion_map.size(), step,
                      MeanOver{count, value.on(distortion_map.device())}, block_pixels);
}

void silhouette(const Tensor<float>& silhouette, const Tensor<float>& mask, double weight,
                Tensor<float>& grad_silhouette, const MeanSlot& value) {
  check_same_shape(silhouette, mask, grad_silhouette);
  const auto count = static_cast<double>(silhouette.size());
  const Silhouette step{silhouette.data(), mask.data(), static_cast<float>(weight / count),
                        grad_silhouette.data()};
  ordered_sum<double>(silhouette.device(), "loss: silhouette", silhouette.size(), step,
                      MeanOver{count, value.on(silhouette.device())}, block_pixels);
}

void depth_prior(const Tensor<float>& depth, const Tensor<float>& prior, double weight,
                 Tensor<float>& grad_depth, const MeanSlot& value) {
  check_same_shape(depth, prior, grad_depth);
  const auto count = static_cast<double>(depth.size());
  const DepthPrior step{depth.data(), prior.data(), static_cast<float>(weight / count), grad_depth.data()};
  ordered_sum<double>(depth.device(), "loss: depth prior", depth.size(), step,
                      MeanOver{count, value.on(depth.device())}, block_pixels);
}

void row_norm(const Tensor<float>& rows, double weight, Tensor<float>& grad_rows, const MeanSlot& value) {
  check_same_shape(rows, rows, grad_rows);
  const auto count = static_cast<double>(rows.dim(0));
  const RowNorm step{rows.data(), rows.row_size(), static_cast<float>(weight / count), grad_rows.data()};
  ordered_sum<double>(rows.device(), "loss: row norms", rows.dim(0), step,
                      MeanOver{count, value.on(rows.device())}, block_pixels);
}

void squared_error(const Tensor<float>& image, const Tensor<float>& target, const Tensor<uint8_t>& known,
                   const MeanSlot& value) {
  check_same_shape(image, target, image);
  const SquaredError error{image.data(), target.data()};
  Mean* const mean = value.on(image.device());
  if (known.empty()) {
    ordered_sum<double>(image.device(), "loss: squared error", image.size(), error,
                        MeanOver{static_cast<double>(image.size()), mean}, block_pixels);
    return;
  }
  require(3 * known.size() == image.size(), "every pixel is known or not", known.shape().to_string());
  ordered_sum<CountedSum>(image.device(), "loss: squared error of what is known", known.size(),
                          KnownSquaredError{error, known.data()}, MeanOverCounted{mean}, block_pixels);
}

}  // namespace traceflow::loss

#include <array>
#include <limits>

#include "ops/loss/loss.h"
#include "ops/loss/loss_kernels.h"

namespace traceflow::loss {

namespace {

// Σ |x − y| over a block and its gradient. Sixteen sums side by side, so that the compiler may use wide
// registers without changing the order of any of them.
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

}  // namespace

double l1(const Tensor<float>& image, const Tensor<float>& target, double weight, Tensor<float>& grad_image) {
  check_same_shape(image, target, grad_image);
  if (image.empty()) return 0;
  const auto count = static_cast<double>(image.size());
  const auto scale = static_cast<float>(weight / count);
  std::vector<double> partial(static_cast<size_t>((image.size() + block_pixels - 1) / block_pixels));
  parallel_blocks("loss: l1", image.size(), block_pixels, [&](int64_t begin, int64_t end) {
    partial[static_cast<size_t>(begin / block_pixels)] =
        l1_block(image.data() + begin, target.data() + begin, end - begin, scale, grad_image.data() + begin);
  });
  double sum = 0;
  for (const double p : partial) sum += p;
  return sum / count;
}

double normal_consistency(const Tensor<float>& normal, const Tensor<float>& pseudo, double weight,
                          Tensor<float>& grad_normal, Tensor<float>& grad_pseudo) {
  return mean_normal_consistency(normal, pseudo, weight, grad_normal, grad_pseudo);
}

double normal_prior(const Tensor<float>& normal, const Tensor<float>& prior, double weight,
                    Tensor<float>& grad_normal) {
  return mean_normal_prior(normal, prior, weight, grad_normal);
}

double distortion(const Tensor<float>& distortion_map, double weight, Tensor<float>& grad_distortion) {
  check_same_shape(distortion_map, distortion_map, grad_distortion);
  if (distortion_map.empty()) return 0;
  const auto count = static_cast<double>(distortion_map.size());
  const auto scale = static_cast<float>(weight / count);
  const double sum = ordered_sum<double>("loss: distortion", distortion_map.size(), [&](int64_t i) {
    grad_distortion[i] += scale;
    return static_cast<double>(distortion_map[i]);
  });
  return sum / count;
}

}  // namespace traceflow::loss

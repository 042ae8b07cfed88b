#include "eval/metrics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "files/png.h"
#include "math/types.h"
#include "ops/loss/loss.h"

namespace traceflow::eval {

namespace {

struct Sum {
  double total = 0;
  int64_t count = 0;
  Sum& operator+=(const Sum& other) {
    total += other.total;
    count += other.count;
    return *this;
  }
  std::optional<double> mean() const {
    if (count == 0) return std::nullopt;
    return total / static_cast<double>(count);
  }
};

bool counts(const Tensor<uint8_t>& mask, int64_t pixel) { return mask.empty() || mask[pixel] != 0; }

double angle_deg(const Vec3<double>& normal, const Vec3<double>& truth) {
  const double length = std::sqrt(dot(normal, normal) * dot(truth, truth));
  if (!(length > 0) || !std::isfinite(length)) return 90;
  // atan2 of sine and cosine keeps small angles exact where acos of a rounded cosine does not.
  const Vec3<double> sine = cross(normal, truth);
  return std::atan2(std::sqrt(dot(sine, sine)), dot(normal, truth)) * 180 / std::numbers::pi;
}

}  // namespace

std::optional<double> psnr(const Tensor<float>& image, const Tensor<float>& target,
                           const Tensor<uint8_t>& mask) {
  require(image.shape() == target.shape(), "image and target have one shape",
          image.shape().to_string() + " and " + target.shape().to_string());
  const Sum sum = ordered_sum<Sum>("metrics: psnr", image.size() / 3, [&](int64_t p) {
    if (!counts(mask, p)) return Sum{};
    const Vec3<double> difference =
        load3<double>(image.data() + 3 * p) - load3<double>(target.data() + 3 * p);
    return Sum{dot(difference, difference), 3};
  });
  const std::optional<double> error = sum.mean();
  if (!error || !(*error > 0) || !std::isfinite(*error)) return std::nullopt;
  return -10 * std::log10(*error);
}

std::optional<double> normal_mae_deg(const Tensor<float>& normal, const Tensor<float>& truth,
                                     const Tensor<uint8_t>& mask) {
  if (truth.empty()) return std::nullopt;
  require(normal.shape() == truth.shape(), "normals and truth have one shape",
          normal.shape().to_string() + " and " + truth.shape().to_string());
  return ordered_sum<Sum>("metrics: normals", truth.size() / 3,
                          [&](int64_t p) {
                            const auto expected = load3<double>(truth.data() + 3 * p);
                            if (!counts(mask, p) || !(dot(expected, expected) > 0)) return Sum{};
                            return Sum{angle_deg(load3<double>(normal.data() + 3 * p), expected), 1};
                          })
      .mean();
}

Metrics measure(const Tensor<float>& colour, const Tensor<float>& normal, const Truth& truth,
                const lpips::Network* network) {
  const Tensor<float> image = from_8bit(to_8bit(colour));
  const Tensor<float> target = from_8bit(to_8bit(truth.colour));
  Metrics m;
  m.psnr = psnr(image, target, {});
  m.ssim = loss::ssim(image, target, {});
  if (network != nullptr && std::min(image.dim(0), image.dim(1)) >= lpips::min_side) {
    m.lpips = lpips::distance(*network, image, target, lpips::Input::defined);
    m.lpips_published = lpips::distance(*network, image, target, lpips::Input::published);
  }
  m.normal_mae_deg = normal_mae_deg(normal, truth.normal, {});
  const auto& mask = truth.mask.values();
  if (std::any_of(mask.begin(), mask.end(), [](uint8_t v) { return v != 0; })) {
    m.masked_psnr = psnr(image, target, truth.mask);
    m.masked_ssim = loss::ssim(image, target, truth.mask);
    m.masked_normal_mae_deg = normal_mae_deg(normal, truth.normal, truth.mask);
  }
  return m;
}

Metrics mean(const std::vector<Metrics>& views) {
  std::vector<Sum> sums;
  for (const Metrics& view : views) {
    size_t next = 0;
    Metrics::visit(view, [&](const char*, const std::optional<double>& value) {
      if (sums.size() <= next) sums.emplace_back();
      if (value) sums[next] += Sum{*value, 1};
      ++next;
    });
  }
  Metrics result;
  size_t next = 0;
  if (!sums.empty())
    Metrics::visit(result, [&](const char*, std::optional<double>& value) { value = sums[next++].mean(); });
  return result;
}

}  // namespace traceflow::eval

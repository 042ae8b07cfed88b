#include "eval/metrics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "eval/mask_core.h"
#include "eval/median.h"
#include "eval/metrics_kernels.h"
#include "ops/loss/loss.h"
#include "primitives/sums.h"

namespace traceflow::eval {

namespace {

const uint8_t* address(const Tensor<uint8_t>& mask) { return mask.empty() ? nullptr : mask.data(); }

// The sum of f(pixel); the host waits for it.
template <class F>
CountedSum sum_of(Device device, const char* description, int64_t pixels, const F& f) {
  Tensor<CountedSum> kept({1}, device);
  ordered_sum<CountedSum>(device, description, pixels, f, KeepSum{kept.data()}, pixels_per_sum);
  return kept.on(Device::cpu)[0];
}

std::optional<double> mean_of(const CountedSum& sum) {
  if (sum.count == 0) return std::nullopt;
  return sum.sum / static_cast<double>(sum.count);
}

// Empty tensors may be on any device.
template <class T>
void require_beside(const Tensor<float>& picture, const Tensor<T>& other) {
  require(other.empty() || other.device() == picture.device(), "a figure's pictures lie on one device");
}

CountedSum squared_error(const Tensor<float>& image, const Tensor<float>& target,
                         const Tensor<uint8_t>& mask) {
  require(image.shape() == target.shape(), "image and target have one shape",
          image.shape().to_string() + " and " + target.shape().to_string());
  require_beside(image, target);
  require_beside(image, mask);
  return sum_of(image.device(), "metrics: psnr", image.size() / 3,
                SquaredError{image.data(), target.data(), address(mask)});
}

std::optional<double> psnr_of(const CountedSum& squared_error) {
  const std::optional<double> error = mean_of(squared_error);
  if (!error || !(*error > 0) || !std::isfinite(*error)) return std::nullopt;
  return -10 * std::log10(*error);
}

// The tensor on a device: itself if it is there, else a copy in `storage`.
template <class T>
const Tensor<T>& brought(const Tensor<T>& tensor, Device device, Tensor<T>& storage) {
  if (tensor.empty() || tensor.device() == device) return tensor;
  storage = tensor.on(device);
  return storage;
}

Tensor<float> rounded(const Tensor<float>& image) {
  Tensor<float> result;
  result.place(image.device()).resize(image.shape());
  parallel_for(image.device(), "metrics: round to 8 bit", image.size(),
               RoundTo8Bit{image.data(), result.data()});
  return result;
}

// The intersection of both masks; if one is empty, the other.
const Tensor<uint8_t>& both(const Tensor<uint8_t>& mask, const Tensor<uint8_t>& known,
                            Tensor<uint8_t>& storage) {
  if (mask.empty() || known.empty()) return mask;
  require(mask.shape() == known.shape(), "masks of one picture have one shape");
  storage.place(mask.device()).resize(mask.shape());
  parallel_for(mask.device(), "metrics: masked and known", mask.size(),
               BothMasks{mask.data(), known.data(), storage.data()});
  return storage;
}

// The core of a mask and what is outside the mask, on its device.
struct Masks {
  Tensor<uint8_t> core, outside;
};

Masks masks_of(const Tensor<uint8_t>& mask) {
  Masks masks;
  masks.core = core_of(mask.on(Device::cpu)).on(mask.device());
  masks.outside.place(mask.device()).resize(mask.shape());
  parallel_for(mask.device(), "metrics: outside the mask", mask.size(),
               OtherMask{mask.data(), masks.outside.data()});
  return masks;
}

// The median of the errors that count, on the host. For an even count, the mean of the two middle values.
std::optional<double> median_error(const Tensor<float>& errors, const Tensor<uint8_t>& mask) {
  std::vector<float> counted;
  for (int64_t i = 0; i < errors.size(); ++i) {
    if (mask[i] != 0 && errors[i] >= 0) counted.push_back(errors[i]);
  }
  if (counted.empty()) return std::nullopt;
  return median(std::span<float>(counted));
}

}  // namespace

std::optional<double> psnr(const Tensor<float>& image, const Tensor<float>& target,
                           const Tensor<uint8_t>& mask) {
  return psnr_of(squared_error(image, target, mask));
}

std::optional<double> normal_mae_deg(const Tensor<float>& normal, const Tensor<float>& truth,
                                     const Tensor<uint8_t>& mask) {
  if (truth.empty()) return std::nullopt;
  require(normal.shape() == truth.shape(), "normals and truth have one shape",
          normal.shape().to_string() + " and " + truth.shape().to_string());
  require_beside(normal, truth);
  require_beside(normal, mask);
  return mean_of(sum_of(normal.device(), "metrics: normals", truth.size() / 3,
                        NormalError{normal.data(), truth.data(), address(mask)}));
}

Tensor<float> depth_errors(const Tensor<float>& depth, const Tensor<float>& alpha, const Tensor<float>& truth,
                           double z_per_truth) {
  require(depth.shape() == truth.shape(), "depths and truth have one shape",
          depth.shape().to_string() + " and " + truth.shape().to_string());
  require(alpha.empty() || alpha.shape() == depth.shape(), "depth and alpha have one shape");
  require_beside(depth, truth);
  require_beside(depth, alpha);
  Tensor<float> errors;
  errors.place(depth.device()).resize(depth.shape());
  parallel_for(depth.device(), "metrics: depths", depth.size(),
               DepthErrors{depth.data(), alpha.empty() ? nullptr : alpha.data(), truth.data(), z_per_truth,
                           errors.data()});
  return errors;
}

Metrics measure(const Rendered& rendered, const Truth& truth, const lpips::Network* network) {
  const Device device = rendered.colour.device();
  const Tensor<uint8_t> all;
  Tensor<float> colour_room, true_normal_room, true_depth_room;
  Tensor<uint8_t> mask_room, known_room, both_room, core_room;
  const Tensor<float> image = rounded(rendered.colour);
  const Tensor<float> target = rounded(brought(truth.colour, device, colour_room));
  const Tensor<float>& true_normals = brought(truth.normal, device, true_normal_room);
  const bool is_all_known = truth.known == nullptr || truth.known->empty();
  const Tensor<uint8_t>& known = brought(is_all_known ? all : *truth.known, device, known_room);
  const Tensor<uint8_t>& mask = brought(truth.mask, device, mask_room);
  Metrics m;
  const CountedSum whole = squared_error(image, target, known);
  m.psnr = psnr_of(whole);
  if (whole.count > 0) m.ssim = loss::ssim(image, target, known);
  if (whole.count > 0 && network != nullptr && std::min(image.dim(0), image.dim(1)) >= lpips::min_side) {
    m.lpips = lpips::distance(*network, image, target, lpips::Input::defined);
    m.lpips_published = lpips::distance(*network, image, target, lpips::Input::published);
  }
  m.normal_mae_deg = normal_mae_deg(rendered.normal, true_normals, {});
  if (mask.empty()) return m;

  const Tensor<uint8_t>& masked_known = both(mask, known, both_room);
  const CountedSum masked = squared_error(image, target, masked_known);
  const Masks masks = masks_of(mask);
  if (masked.count > 0) {
    m.masked_psnr = psnr_of(masked);
    m.masked_ssim = loss::ssim(image, target, masked_known);
    m.masked_normal_mae_deg = normal_mae_deg(rendered.normal, true_normals, mask);
    m.core_psnr = psnr_of(squared_error(image, target, both(masks.core, known, core_room)));
  }
  if (truth.depth == nullptr || truth.depth->empty() || rendered.depth.empty()) return m;

  const Tensor<float> errors = depth_errors(
      rendered.depth, rendered.alpha, brought(*truth.depth, device, true_depth_room), truth.z_per_truth);
  const Tensor<float> errors_on_host = errors.on(Device::cpu);
  const auto put = [&](const Tensor<uint8_t>& where, std::optional<double>& mean,
                       std::optional<double>& median) {
    mean = mean_of(
        sum_of(device, "metrics: depth error", errors.size(), MeanError{errors.data(), where.data()}));
    median = median_error(errors_on_host, where.on(Device::cpu));
  };
  put(mask, m.masked_depth_error_mean, m.masked_depth_error_median);
  put(masks.core, m.core_depth_error_mean, m.core_depth_error_median);
  put(masks.outside, m.outside_depth_error_mean, m.outside_depth_error_median);
  return m;
}

Metrics mean(const std::vector<Metrics>& views) {
  std::vector<CountedSum> sums;
  for (const Metrics& view : views) {
    size_t next = 0;
    Metrics::visit(view, [&](const char*, const std::optional<double>& value) {
      if (sums.size() <= next) sums.emplace_back();
      if (value) sums[next] += CountedSum{*value, 1};
      ++next;
    });
  }
  Metrics result;
  size_t next = 0;
  if (!sums.empty())
    Metrics::visit(result, [&](const char*, std::optional<double>& value) { value = mean_of(sums[next++]); });
  return result;
}

}  // namespace traceflow::eval

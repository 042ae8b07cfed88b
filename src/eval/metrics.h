#pragma once

#include <optional>
#include <vector>

#include "base/tensor.h"
#include "ops/lpips/lpips.h"

// Compares a rendered view with the photograph (method §8). A metric that is not available is absent. Metrics
// are computed on the images' device; the host waits for each.
namespace traceflow::eval {

struct Metrics {
  std::optional<double> psnr;  // dB; absent for equal images
  std::optional<double> ssim;
  std::optional<double> lpips;            // input in [−1, 1], as defined
  std::optional<double> lpips_published;  // input in [0, 1], as in published tables
  std::optional<double> masked_psnr;
  std::optional<double> masked_ssim;
  std::optional<double> core_psnr;  // in the core of the mask (eval/mask_core.h)
  std::optional<double> normal_mae_deg;
  std::optional<double> masked_normal_mae_deg;
  // Errors |rendered z / true z − 1| inside the mask, in its core and outside it.
  std::optional<double> masked_depth_error_median;
  std::optional<double> masked_depth_error_mean;
  std::optional<double> core_depth_error_median;
  std::optional<double> core_depth_error_mean;
  std::optional<double> outside_depth_error_median;
  std::optional<double> outside_depth_error_mean;

  // Calls f(name, value) for every metric, in the order of the report.
  template <class Self, class F>
  static void visit(Self& self, F&& f) {
    f("psnr", self.psnr);
    f("ssim", self.ssim);
    f("lpips", self.lpips);
    f("lpips_published", self.lpips_published);
    f("masked_psnr", self.masked_psnr);
    f("masked_ssim", self.masked_ssim);
    f("core_psnr", self.core_psnr);
    f("normal_mae_deg", self.normal_mae_deg);
    f("masked_normal_mae_deg", self.masked_normal_mae_deg);
    f("masked_depth_error_median", self.masked_depth_error_median);
    f("masked_depth_error_mean", self.masked_depth_error_mean);
    f("core_depth_error_median", self.core_depth_error_median);
    f("core_depth_error_mean", self.core_depth_error_mean);
    f("outside_depth_error_median", self.outside_depth_error_median);
    f("outside_depth_error_mean", self.outside_depth_error_mean);
  }
};

// 10·log10(1 / mean squared error) over all channels of all pixels or, with a mask (H×W), of its nonzero
// pixels. Absent if the mask is empty, or if the error is zero or not finite.
std::optional<double> psnr(const Tensor<float>& image, const Tensor<float>& target,
                           const Tensor<uint8_t>& mask);

// Mean angle in degrees between the rendered normal (any length) and the true one (unit), where the true one
// is not zero and, with a mask, inside it. Pixels where nothing was rendered count as 90°, so that holes do
// not improve the metric.
std::optional<double> normal_mae_deg(const Tensor<float>& normal, const Tensor<float>& truth,
                                     const Tensor<uint8_t>& mask);

// |rendered z / true z − 1| of every pixel (H×W each, any units: z_per_truth converts true depths to rendered
// units), −1 if the true depth is unknown (0). Where nothing was rendered the error is 1, as for a depth of
// 0, so that holes do not improve the metric. Nothing was rendered if the depth is not positive and finite or
// if alpha is below 0.5, since then most light comes from behind. alpha may be empty.
Tensor<float> depth_errors(const Tensor<float>& depth, const Tensor<float>& alpha, const Tensor<float>& truth,
                           double z_per_truth);

// The rendered layers, all on one device. Depth and alpha may be empty: no depth errors, alpha 1.
struct Rendered {
  const Tensor<float>& colour;  // H×W×3
  const Tensor<float>& normal;  // H×W×3, any length
  const Tensor<float>& depth;   // H×W, expected camera z
  const Tensor<float>& alpha;   // H×W
};

// The ground truth of a view, on any device. Tensors that the capture lacks are empty.
struct Truth {
  const Tensor<float>& colour;
  const Tensor<uint8_t>& mask;
  const Tensor<float>& normal;
  const Tensor<uint8_t>* known = nullptr;  // H×W, where colours are known; null or empty: everywhere
  const Tensor<float>* depth = nullptr;    // H×W, 0 if unknown; null or empty: all unknown
  double z_per_truth = 1;                  // rendered units per unit of true depth
};

// All metrics of one view, computed on the device of its colours, except the mask's core and the medians,
// which the host computes. Colours are first rounded to 8 bits. network may be null: no LPIPS. Means of
// colour errors are over known pixels; LPIPS uses the whole image.
Metrics measure(const Rendered& rendered, const Truth& truth, const lpips::Network* network);

// The mean of each metric over the views that have it.
Metrics mean(const std::vector<Metrics>& views);

}  // namespace traceflow::eval

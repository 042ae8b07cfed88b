#pragma once

#include <optional>
#include <vector>

#include "base/tensor.h"
#include "ops/lpips/lpips.h"

// How near a rendered view comes to the photograph (method §8). Every figure is absent where it cannot be
// had. Figures are computed where the pictures are; the host waits for each.
namespace traceflow::eval {

struct Metrics {
  std::optional<double> psnr;  // dB; absent for equal images, whose PSNR has no bound
  std::optional<double> ssim;
  std::optional<double> lpips;            // [−1, 1] input, as defined
  std::optional<double> lpips_published;  // [0, 1] input, as published tables used it
  std::optional<double> masked_psnr;
  std::optional<double> masked_ssim;
  std::optional<double> core_psnr;  // in the mask without its rim (eval/mask_core.h)
  std::optional<double> normal_mae_deg;
  std::optional<double> masked_normal_mae_deg;
  // Of |rendered z / true z − 1| inside the mask, in its core and outside it.
  std::optional<double> masked_depth_error_median;
  std::optional<double> masked_depth_error_mean;
  std::optional<double> core_depth_error_median;
  std::optional<double> core_depth_error_mean;
  std::optional<double> outside_depth_error_median;
  std::optional<double> outside_depth_error_mean;

  // f(name, value) for every figure, in the order of the report.
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

// 10·log10(1 / mean squared error) over all channels of all pixels, or of the pixels where the mask (H×W) is
// not zero when there is one. Absent when the mask holds no pixel, and when the error is zero or not finite.
std::optional<double> psnr(const Tensor<float>& image, const Tensor<float>& target,
                           const Tensor<uint8_t>& mask);

// Mean angle in degrees between the rendered normal (any length) and the truth (unit) where truth is not
// zero, within the mask when there is one. Where nothing was rendered the angle is 90: a hole must not
// improve the figure.
std::optional<double> normal_mae_deg(const Tensor<float>& normal, const Tensor<float>& truth,
                                     const Tensor<uint8_t>& mask);

// |rendered z / true z − 1| of every pixel (H×W each, any units: z_per_truth turns true ones into rendered
// ones), −1 where there is no truth (0). Where nothing was rendered the error is 1, that of a depth of 0: a
// hole must not improve the figure. Nothing is a depth that is not positive and finite, and one under an
// alpha below 0.5, where more is seen through than is seen; alpha may be empty.
Tensor<float> depth_errors(const Tensor<float>& depth, const Tensor<float>& alpha, const Tensor<float>& truth,
                           double z_per_truth);

// What was rendered, all on one device. Depth and alpha may be empty: no depth errors, alpha 1.
struct Rendered {
  const Tensor<float>& colour;  // H×W×3
  const Tensor<float>& normal;  // H×W×3, any length
  const Tensor<float>& depth;   // H×W, expected camera z
  const Tensor<float>& alpha;   // H×W
};

// What a view is judged against, on any device. Tensors that the capture lacks are empty.
struct Truth {
  const Tensor<float>& colour;
  const Tensor<uint8_t>& mask;
  const Tensor<float>& normal;
  const Tensor<uint8_t>* known = nullptr;  // H×W, where colours count; null or empty: everywhere
  const Tensor<float>* depth = nullptr;    // H×W, 0 where there is none; null or empty: nowhere
  double z_per_truth = 1;                  // rendered units in one of the true depth's
};

// All figures of one view, computed where its colours are, but for the mask's core and the medians, which the
// host finds. Colours are rounded to 8 bit first. network may be null: no LPIPS. The mean errors of colours
// are over known pixels; LPIPS takes the picture as a whole.
Metrics measure(const Rendered& rendered, const Truth& truth, const lpips::Network* network);

// Each figure's mean over the views that have it.
Metrics mean(const std::vector<Metrics>& views);

}  // namespace traceflow::eval

#include "train/objective.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/parallel.h"
#include "ops/loss/loss.h"

namespace traceflow {

namespace {

double psnr(const Tensor<float>& image, const Tensor<float>& target) {
  const double sum = ordered_sum<double>("objective: psnr", image.size(), [&](int64_t i) {
    const double difference = static_cast<double>(image[i]) - static_cast<double>(target[i]);
    return difference * difference;
  });
  return -10.0 * std::log10(std::max(sum / static_cast<double>(image.size()), 1e-10));
}

}  // namespace

LossTerms evaluate_objective(const Frame& frame, const ViewImages& target, const LossOptions& options,
                             bool normal_losses, FrameGradient& gradient, const lpips::Network* perceptual) {
  LossTerms terms;
  gradient.colour.reset(frame.colour.shape());
  const bool consistency = normal_losses && options.normal > 0;
  const bool prior = normal_losses && options.normal_prior > 0 && !target.normal_prior.empty();
  const Shape none{0};
  gradient.normal.reset(consistency || prior ? frame.raster.normal.shape() : none);
  gradient.pseudo_normal.reset(consistency ? frame.raster.normal.shape() : none);
  gradient.distortion.resize(none);

  terms.psnr = psnr(frame.colour, target.colour);
  terms.l1 = loss::l1(frame.colour, target.colour, 1 - options.ssim, gradient.colour);
  terms.total += (1 - options.ssim) * terms.l1;
  if (options.ssim > 0) {
    terms.ssim = loss::ssim_loss(frame.colour, target.colour, options.ssim, gradient.colour);
    terms.total += options.ssim * terms.ssim;
  }
  if (consistency) {
    terms.normal = loss::normal_consistency(frame.raster.normal, frame.pseudo_normal, options.normal,
                                            gradient.normal, gradient.pseudo_normal);
    terms.total += options.normal * terms.normal;
  }
  if (prior) {
    terms.normal_prior =
        loss::normal_prior(frame.raster.normal, target.normal_prior, options.normal_prior, gradient.normal);
    terms.total += options.normal_prior * terms.normal_prior;
  }
  if (options.distortion > 0) {
    gradient.distortion.reset(frame.raster.distortion.shape());
    terms.distortion = loss::distortion(frame.raster.distortion, options.distortion, gradient.distortion);
    terms.total += options.distortion * terms.distortion;
  }
  if (perceptual != nullptr) {
    terms.lpips = lpips::distance(*perceptual, frame.colour, target.colour, lpips::Input::defined,
                                  options.lpips, gradient.colour);
    terms.total += options.lpips * terms.lpips;
  }
  return terms;
}

std::optional<lpips::Network> perceptual_network(const LossOptions& options, const Capture& capture) {
  if (options.lpips == 0) return std::nullopt;
  for (const View& view : capture.train) {
    if (std::min(view.camera.width, view.camera.height) < lpips::min_side) {
      throw InputError(
          capture.folder.string(), view.id,
          std::to_string(view.camera.width) + "x" + std::to_string(view.camera.height) + " pixels",
          std::to_string(lpips::min_side) + " pixels a side, which loss.lpips needs");
    }
  }
  return lpips::network_of(lpips::read_weights(options.lpips_weights));
}

}  // namespace traceflow

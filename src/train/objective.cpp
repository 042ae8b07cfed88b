#include "train/objective.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "ops/loss/loss.h"

namespace traceflow {

namespace {

std::optional<double> psnr(const loss::Mean& squared_error) {
  if (squared_error.count == 0) return std::nullopt;
  return -10.0 * std::log10(std::max(squared_error.value, 1e-10));
}

}  // namespace

void LossMeans::begin(Device device) {
  means_.place(device).reset({term_count});
  weight_ = {};
}

loss::MeanSlot LossMeans::add(Term term, double weight) {
  weight_[term] = weight;
  return {means_, term};
}

LossTerms LossMeans::read() const {
  LossTerms terms;
  const Tensor<loss::Mean> means = means_.on(Device::cpu);
  const std::array<double*, squared_error> values{
      &terms.l1,    &terms.ssim,     &terms.normal,     &terms.normal_prior,        &terms.distortion,
      &terms.lpips, &terms.rigidity, &terms.silhouette, &terms.environment_residual};
  for (size_t term = 0; term < values.size(); ++term) {
    if (!weight_[term]) continue;
    *values[term] = means[static_cast<int64_t>(term)].value;
    terms.total += *weight_[term] * *values[term];
  }
  if (weight_[squared_error]) terms.psnr = psnr(means[squared_error]);
  return terms;
}

void evaluate_objective(const Frame& frame, const ViewImages& target, const LossOptions& options,
                        NormalLosses normals, FrameGradient& gradient, LossMeans& means,
                        const lpips::Network* perceptual) {
  const Device device = frame.colour.device();
  const bool consistency = normals != NormalLosses::none && options.normal > 0;
  const bool prior =
      normals != NormalLosses::none && options.normal_prior > 0 && !target.normal_prior.empty();
  const Shape none{0}, colours = frame.colour.shape(), shape = frame.raster.normal.shape();
  means.begin(device);
  gradient.colour.place(device).reset(colours);
  gradient.normal.place(device).reset(consistency || prior ? shape : none);
  gradient.pseudo_normal.place(device).reset(consistency ? shape : none);
  gradient.distortion.place(device).reset(options.distortion > 0 ? frame.raster.distortion.shape() : none);

  const auto slot = [&](LossMeans::Term term, double weight) { return means.add(term, weight); };
  loss::squared_error(frame.colour, target.colour, target.known, slot(LossMeans::squared_error, 0));
  loss::l1(frame.colour, target.colour, 1 - options.ssim, gradient.colour,
           slot(LossMeans::l1, 1 - options.ssim));
  if (options.ssim > 0) {
    loss::ssim_loss(frame.colour, target.colour, options.ssim, gradient.colour,
                    slot(LossMeans::ssim, options.ssim));
  }
  if (consistency) {
    loss::normal_consistency(frame.raster.normal, frame.pseudo_normal, options.normal, gradient.normal,
                             gradient.pseudo_normal, slot(LossMeans::normal, options.normal));
  }
  if (prior) {
    const Tensor<float> nowhere;
    const Tensor<float>& tint = normals == NormalLosses::more_on_mirrors ? frame.raster.tint : nowhere;
    loss::normal_prior(frame.raster.normal, target.normal_prior, tint, options.normal_prior_on_mirrors,
                       options.normal_prior, gradient.normal,
                       slot(LossMeans::normal_prior, options.normal_prior));
  }
  if (options.distortion > 0) {
    loss::distortion(frame.raster.distortion, options.distortion, gradient.distortion,
                     slot(LossMeans::distortion, options.distortion));
  }
  gradient.silhouette.place(device).reset(frame.raster.silhouette.shape());
  if (!frame.raster.silhouette.empty()) {
    loss::silhouette(frame.raster.silhouette, target.coverage, options.silhouette, gradient.silhouette,
                     slot(LossMeans::silhouette, options.silhouette));
  }
  if (perceptual != nullptr) {
    lpips::distance(*perceptual, frame.colour, target.colour, lpips::Input::defined, options.lpips,
                    gradient.colour, slot(LossMeans::lpips, options.lpips));
  }
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

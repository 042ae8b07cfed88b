#include "train/objective.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "ops/loss/loss.h"
#include "ops/loss/rigidity.h"

namespace traceflow {

namespace {

std::optional<double> psnr(const loss::Mean& squared_error) {
  if (squared_error.count == 0) return std::nullopt;
  return -10.0 * std::log10(std::max(squared_error.value, 1e-10));
}

double normal_weight(const LossInputs& in) {
  return in.normals == NormalLosses::none ? 0 : double{in.options.normal};
}

double normal_prior_weight(const LossInputs& in) {
  const bool counts = in.normals != NormalLosses::none && !in.target.normal_prior.empty();
  return counts ? double{in.options.normal_prior} : 0;
}

}  // namespace

std::span<const LossTerm> loss_terms() {
  static const LossTerm terms[] = {
      {"l1", [](const LossInputs& in) { return double{1 - in.options.ssim}; },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         loss::l1(in.frame.colour, in.target.colour, weight, g.frame.colour, slot);
       }},
      {"ssim", [](const LossInputs& in) { return double{in.options.ssim}; },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         loss::ssim_loss(in.frame.colour, in.target.colour, weight, g.frame.colour, slot);
       }},
      {"normal", normal_weight,
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         g.frame.alpha.reset(in.frame.raster.alpha.shape());
         g.frame.pseudo_normal.reset(in.frame.raster.normal.shape());
         loss::normal_consistency(in.frame.raster.normal, in.frame.raster.alpha, in.frame.pseudo_normal,
                                  weight, g.frame.normal, g.frame.alpha, g.frame.pseudo_normal, slot);
       }},
      {"normal_prior", normal_prior_weight,
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         const Tensor<float> nowhere;
         const bool by_tint = in.normals == NormalLosses::more_on_mirrors;
         loss::normal_prior(in.frame.raster.normal, in.target.normal_prior,
                            by_tint ? in.frame.raster.tint : nowhere, in.options.normal_prior_on_mirrors,
                            weight, g.frame.normal, slot);
       }},
      {"depth_prior",
       [](const LossInputs& in) {
         return in.target.depth_prior.empty() ? 0 : in.depth_prior_share * in.options.depth_prior;
       },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         g.frame.depth.reset(in.frame.raster.depth.shape());
         loss::depth_prior(in.frame.raster.depth, in.target.depth_prior, weight, g.frame.depth, slot);
       }},
      {"distortion", [](const LossInputs& in) { return double{in.options.distortion}; },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         g.frame.distortion.reset(in.frame.raster.distortion.shape());
         loss::distortion(in.frame.raster.distortion, weight, g.frame.distortion, slot);
       }},
      {"lpips", [](const LossInputs& in) { return in.perceptual == nullptr ? 0 : double{in.options.lpips}; },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         lpips::distance(*in.perceptual, in.frame.colour, in.target.colour, lpips::Input::defined, weight,
                         g.frame.colour, slot);
       }},
      {"rigidity",
       [](const LossInputs& in) { return in.neighbours == nullptr ? 0 : double{in.options.rigidity}; },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         g.frame.main_position.reset(in.frame.main.position.shape());
         g.rest.reset(in.rest->shape());
         loss::rigidity(*in.rest, in.frame.main.position, in.frame.subset, *in.neighbours,
                        in.options.rigidity_strain, weight, g.rest, g.frame.main_position, slot);
       }},
      {"silhouette",
       [](const LossInputs& in) {
         return in.frame.raster.silhouette.empty() ? 0 : double{in.options.silhouette};
       },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         loss::silhouette(in.frame.raster.silhouette, in.target.coverage, weight, g.frame.silhouette, slot);
       }},
      {"environment_residual",
       [](const LossInputs& in) {
         const bool counts = in.environment_residuals != nullptr && !in.environment_residuals->empty();
         return counts ? double{in.options.environment_residual} : 0;
       },
       [](const LossInputs& in, double weight, const LossGradient& g, const loss::MeanSlot& slot) {
         g.frame.environment_residuals.reset(in.environment_residuals->shape());
         loss::row_norm(*in.environment_residuals, weight, g.frame.environment_residuals, slot);
       }},
  };
  return terms;
}

double LossValues::operator[](std::string_view name) const {
  for (const LossValue& term : terms) {
    if (term.name == name) return term.value;
  }
  return 0;
}

void LossMeans::begin(Device device) {
  const auto count = static_cast<int64_t>(loss_terms().size()) + 1;
  means_.place(device).reset({count});
  weight_.assign(static_cast<size_t>(count), std::nullopt);
}

loss::MeanSlot LossMeans::add(size_t term, double weight) {
  weight_[term] = weight;
  return {means_, static_cast<int64_t>(term)};
}

LossValues LossMeans::read() const {
  LossValues values;
  const Tensor<loss::Mean> means = means_.on(Device::cpu);
  const std::span<const LossTerm> terms = loss_terms();
  for (size_t k = 0; k < terms.size(); ++k) {
    if (!weight_[k]) continue;
    values.terms.push_back({terms[k].name, *weight_[k], means[static_cast<int64_t>(k)].value});
    values.total += values.terms.back().weight * values.terms.back().value;
  }
  if (weight_[terms.size()]) values.psnr = psnr(means[static_cast<int64_t>(terms.size())]);
  return values;
}

void evaluate_objective(const LossInputs& inputs, const LossGradient& gradient, LossMeans& means) {
  const Frame& frame = inputs.frame;
  const Device device = frame.colour.device();
  const std::span<const LossTerm> terms = loss_terms();
  means.begin(device);
  const Shape none{0};
  gradient.frame.colour.place(device).reset(frame.colour.shape());
  gradient.frame.silhouette.place(device).reset(frame.raster.silhouette.shape());
  for (Tensor<float>* unused :
       {&gradient.frame.pseudo_normal, &gradient.frame.depth, &gradient.frame.alpha,
        &gradient.frame.distortion, &gradient.frame.main_position, &gradient.frame.environment_residuals})
    unused->place(device).reset(none);
  gradient.rest.place(device).reset(none);
  const bool has_normals = normal_weight(inputs) > 0 || normal_prior_weight(inputs) > 0;
  gradient.frame.normal.place(device).reset(has_normals ? frame.raster.normal.shape() : none);

  loss::squared_error(frame.colour, inputs.target.colour, inputs.target.known, means.add(terms.size(), 0));
  for (size_t k = 0; k < terms.size(); ++k) {
    const double weight = terms[k].weight(inputs);
    if (weight > 0) terms[k].add(inputs, weight, gradient, means.add(k, weight));
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

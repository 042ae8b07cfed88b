#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "capture/capture.h"
#include "ops/loss/mean.h"
#include "ops/lpips/lpips.h"
#include "render/frame.h"
#include "scene/neighbours.h"
#include "train/options.h"

namespace traceflow {

// How the terms on normals count in an iteration (method §7.4): not at all; with priors that count the same
// everywhere; or with priors that count more by the tint, loss.normal_prior_on_mirrors times where it is 1.
enum class NormalLosses { none, even, more_on_mirrors };

// What the loss of one frame is computed from. Null and empty inputs leave out the terms that need them.
struct LossInputs {
  const Frame& frame;
  const ViewImages& target;
  const LossOptions& options;
  NormalLosses normals = NormalLosses::none;
  const lpips::Network* perceptual = nullptr;
  // Positions of the stored main surfels and the edges between neighbours, for the rigidity.
  const Tensor<float>* rest = nullptr;
  const Neighbours* neighbours = nullptr;
  // What the environment's field adds to each surfel.
  const Tensor<float>* environment_residuals = nullptr;
  // The share of loss.depth_prior that counts (Schedule::depth_prior_share).
  double depth_prior_share = 0;
};

// The gradient of the loss.
struct LossGradient {
  FrameGradient& frame;
  Tensor<float>& rest;  // by the stored positions; empty where no term depends on them
};

// One term of the loss (method §7.4). A new term is one entry of loss_terms() and its weight in LossOptions.
struct LossTerm {
  std::string_view name;  // in events and the log
  // Its weight in the sum; 0: it is not computed.
  double (*weight)(const LossInputs&);
  // Computes it and adds `weight` times its gradient.
  void (*add)(const LossInputs&, double weight, const LossGradient&, const loss::MeanSlot&);
};

// In the order in which they are computed and added up.
std::span<const LossTerm> loss_terms();

// The value of one term, unweighted.
struct LossValue {
  std::string_view name;
  double weight = 0;
  double value = 0;
};

// The loss of one frame.
struct LossValues {
  double total = 0;              // the weighted sum
  std::vector<LossValue> terms;  // those that were computed
  std::optional<double> psnr;    // dB, not rounded; absent where no pixel of the photograph is known

  // 0 where the term was not computed.
  double operator[](std::string_view name) const;
};

// The terms of one frame's loss on the frame's device. Only read() waits for the device.
class LossMeans {
 public:
  void begin(Device device);
  // term: an index into loss_terms(), or their number for the squared error. Returns where the term stores
  // its value.
  loss::MeanSlot add(size_t term, double weight);
  LossValues read() const;

 private:
  Tensor<loss::Mean> means_;
  std::vector<std::optional<double>> weight_;
};

// Compares a frame with its photograph and sets dL/dframe and dL/d(stored positions).
void evaluate_objective(const LossInputs& inputs, const LossGradient& gradient, LossMeans& means);

// The LPIPS network, if the options give LPIPS a weight. Throws InputError when its file cannot be used or
// when the capture's images are too small for it.
std::optional<lpips::Network> perceptual_network(const LossOptions& options, const Capture& capture);

}  // namespace traceflow

#pragma once

#include <array>
#include <optional>

#include "capture/capture.h"
#include "ops/loss/mean.h"
#include "ops/lpips/lpips.h"
#include "render/frame.h"
#include "train/options.h"

namespace traceflow {

// The training loss of one frame (method §7.4), term by term, unweighted.
struct LossTerms {
  double total = 0;  // the weighted sum
  double l1 = 0;
  double ssim = 0;          // 1 − SSIM
  double normal = 0;        // L_norm
  double normal_prior = 0;  // L_tc-norm
  double distortion = 0;
  double rigidity = 0;
  double silhouette = 0;
  double environment_residual = 0;
  double lpips = 0;
  // dB, of the image as it is, not rounded; absent where nothing of the photograph is known.
  std::optional<double> psnr;
};

// The terms of one frame's loss as they were computed, on the frame's device: nobody waits for them until
// they are read.
class LossMeans {
 public:
  // In the order in which they are added up; the last is no term of the sum.
  enum Term {
    l1,
    ssim,
    normal,
    normal_prior,
    distortion,
    lpips,
    rigidity,
    silhouette,
    environment_residual,
    squared_error,
    term_count
  };

  // Forgets the last frame's.
  void begin(Device device);
  // Where a term that counts with this weight leaves its value.
  loss::MeanSlot add(Term term, double weight);
  // Waits for the device. Terms that were not added are 0.
  LossTerms read() const;

 private:
  Tensor<loss::Mean> means_;
  std::array<std::optional<double>, term_count> weight_;
};

// How the terms on normals count in an iteration (method §7.4): not at all; with priors that count the same
// everywhere; or with priors that count more by the tint, loss.normal_prior_on_mirrors times where it is 1.
enum class NormalLosses { none, even, more_on_mirrors };

// Compares a frame with its photograph and sets dL/dframe. perceptual: the network of LPIPS where that
// counts.
void evaluate_objective(const Frame& frame, const ViewImages& target, const LossOptions& options,
                        NormalLosses normals, FrameGradient& gradient, LossMeans& means,
                        const lpips::Network* perceptual = nullptr);

// The network of LPIPS where the options give it a weight. Throws InputError where its file cannot be used or
// the capture's images are too small for it.
std::optional<lpips::Network> perceptual_network(const LossOptions& options, const Capture& capture);

}  // namespace traceflow

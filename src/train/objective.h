#pragma once

#include <array>
#include <optional>

#include "capture/capture.h"
#include "ops/loss/mean.h"
#include "ops/lpips/lpips.h"
#include "render/frame.h"
#include "train/options.h"

namespace traceflow {

// The training loss of one frame (method §7.4), by unweighted terms.
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
  // dB, of the image without rounding; empty if no pixel of the photograph is known.
  std::optional<double> psnr;
};

// The terms of a frame's loss as computed, on the frame's device. Only reading them waits for the device.
class LossMeans {
 public:
  // In the order of summation. squared_error is not part of the sum.
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

  // Discards the values of the last frame.
  void begin(Device device);
  // The slot for the value of a term with this weight.
  loss::MeanSlot add(Term term, double weight);
  // Waits for the device. Terms that were not added are 0.
  LossTerms read() const;

 private:
  Tensor<loss::Mean> means_;
  std::array<std::optional<double>, term_count> weight_;
};

// How the normal losses count in an iteration (method §7.4): not at all; with equal weights of priors; or
// with weights that grow with the tint, up to loss.normal_prior_on_mirrors where it is 1.
enum class NormalLosses { none, even, more_on_mirrors };

// Compares a frame with its photograph and sets dL/dframe. perceptual: the LPIPS network, if LPIPS counts.
void evaluate_objective(const Frame& frame, const ViewImages& target, const LossOptions& options,
                        NormalLosses normals, FrameGradient& gradient, LossMeans& means,
                        const lpips::Network* perceptual = nullptr);

// The LPIPS network, if the options give LPIPS a weight. Throws InputError when its file cannot be used or
// when the capture's images are too small for it.
std::optional<lpips::Network> perceptual_network(const LossOptions& options, const Capture& capture);

}  // namespace traceflow

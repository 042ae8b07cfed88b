#pragma once

#include <optional>

#include "capture/capture.h"
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
  double lpips = 0;
  double psnr = 0;  // dB, of the image as it is, not rounded
};

// Compares a frame with its photograph and sets dL/dframe. normal_losses: the terms on normals count in this
// iteration; perceptual: the network of LPIPS where that counts.
LossTerms evaluate_objective(const Frame& frame, const ViewImages& target, const LossOptions& options,
                             bool normal_losses, FrameGradient& gradient,
                             const lpips::Network* perceptual = nullptr);

// The network of LPIPS where the options give it a weight. Throws InputError where its file cannot be used or
// the capture's images are too small for it.
std::optional<lpips::Network> perceptual_network(const LossOptions& options, const Capture& capture);

}  // namespace traceflow

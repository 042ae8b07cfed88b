#pragma once

#include "capture/capture.h"
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
  double psnr = 0;  // dB, of the image as it is, not rounded
};

// Compares a frame with its photograph and sets dL/dframe. normal_losses: the terms on normals count in this
// iteration.
LossTerms evaluate_objective(const Frame& frame, const ViewImages& target, const LossOptions& options,
                             bool normal_losses, FrameGradient& gradient);

}  // namespace traceflow

#pragma once

#include "capture/capture.h"
#include "render/renderer.h"
#include "train/options.h"

namespace traceflow {

struct CameraAlignment {
  int iterations = 80;
  double rate = 1e-3;      // first iteration: radians, and extents for translations
  double rate_end = 2e-5;  // last iteration, log-linear in between
};

// The camera near that of the request for which the render at the request's time has the lowest loss (L1 and
// SSIM, loss.ssim) against the photograph. A scene that trained with refined cameras may not fit held-out
// cameras as given. BARF (Lin et al. 2021, §4.2) therefore measures with aligned ones. The photograph has the
// size of the request's camera and is on the scene's device; its unknown pixels are overwritten.
Camera<float> aligned_camera(Renderer& renderer, const Scene& scene, const FrameRequest& request,
                             ViewImages& photograph, const LossOptions& loss,
                             const CameraAlignment& options = {});

}  // namespace traceflow

#pragma once

#include "capture/capture.h"
#include "render/renderer.h"
#include "train/options.h"

namespace traceflow {

struct CameraAlignment {
  int iterations = 80;
  double rate = 1e-3;      // radians, first iteration; shifts in extents
  double rate_end = 2e-5;  // last iteration, log-linear between
};

// The camera, near that of the request, from which a scene at the request's time looks most like the
// photograph by L1 and SSIM (loss.ssim). A scene whose training cameras were refined may fit held-out cameras
// as they were given less well; BARF (Lin et al. 2021, §4.2) measures with aligned ones for that. The
// photograph has the size of the request's camera and is on the scene's device; what is unknown of it is
// overwritten.
Camera<float> aligned_camera(Renderer& renderer, const Scene& scene, const FrameRequest& request,
                             ViewImages& photograph, const LossOptions& loss,
                             const CameraAlignment& options = {});

}  // namespace traceflow

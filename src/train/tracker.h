#pragma once

#include <memory>
#include <vector>

#include "capture/capture.h"
#include "render/render_options.h"
#include "scene/scene.h"
#include "train/options.h"

namespace traceflow {

// Finds where rigid bodies are at a time of the film: Gauss–Newton on six numbers a body, from what does not
// depend on how their surface reflects: that they cover what the masks cover, and that their normals are
// those of the capture's priors. The priors' error, which estimators share over a picture, is turned away by
// one rotation a view, from what stands still. Works on the CPU on pictures of at most 160 pixels' width.
class Tracker {
 public:
  Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture);

  // Puts key k where bodies that go on as in the three keys before would be, and the keys behind it there
  // too.
  static void predict(Motion& motion, int64_t key);
  // Finds the poses of key k from where they are. main, motion: on the CPU. blur: of the first step, pixels.
  void solve(const Surfels& main, Motion& motion, int64_t key, float extent, int steps, double blur) const;

 private:
  // A view at the size for tracking.
  struct Target {
    Camera<float> camera;
    bool is_shrunk = false;
    Tensor<float> coverage;      // H×W
    Tensor<uint8_t> mask;        // H×W
    Tensor<float> normal_prior;  // H×W×3 or empty
  };
  Target target_of(const View& view) const;

  TrackOptions options_;
  RenderOptions render_;
  const Capture& capture_;
};

}  // namespace traceflow

#pragma once

#include <functional>

#include "capture/capture.h"
#include "render/renderer.h"
#include "train/options.h"

namespace traceflow {

// Told how many of all steps are done; false stops.
using StepsDone = std::function<bool(int64_t done, int64_t all)>;

// How far two pictures (H×W×3) are apart at each pixel (H×W): the largest channel of their mean difference
// over squares of five pixels.
Tensor<float> mean_difference(const Tensor<float>& a, const Tensor<float>& b);

// The part of a film that stands still: surfels that do not move, trained on all times. What moves is found
// out by its photographs: a surfel stays where at least half of those that show it agree with it. On the CPU.
class StillScene {
 public:
  // Learns from a capture's training views; their masks are not used. The film should be small: 160 pixels
  // wide. Stops early where `told` says so.
  StillScene(const Capture& capture, const TrainOptions& options, int iterations, const StepsDone& told);

  // How it looks in a view.
  struct Look {
    Tensor<float> colour;     // H×W×3
    Tensor<float> agreement;  // H×W, blended over what is seen: the share of photographs that agree with it
  };
  Look look(const View& view);
  // Of points (P×3), those beside which a surfel stands that most photographs agree with.
  Tensor<float> standing(const Tensor<float>& points) const;

 private:
  Scene scene_;           // as it looks
  Scene agreement_;       // as grey as its photographs agree
  Tensor<float> agreed_;  // M×3, where surfels are that most photographs agree with
  Renderer renderer_, agreement_renderer_;
};

}  // namespace traceflow

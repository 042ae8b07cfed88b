#pragma once

#include <functional>

#include "capture/capture.h"
#include "render/renderer.h"
#include "train/options.h"

namespace traceflow {

// Called with the number of steps done and of all steps; returns false to stop.
using StepsDone = std::function<bool(int64_t done, int64_t all)>;

// The difference of two images (H×W×3) at each pixel (H×W): the largest channel of the mean difference over
// squares of 5×5 pixels.
Tensor<float> mean_difference(const Tensor<float>& a, const Tensor<float>& b);

// The static part of a video: surfels that do not move, trained on all times. The photographs decide what
// moves: a surfel stays if at least half of the photographs that show it agree with it. On the CPU.
class StillScene {
 public:
  // Trains on a capture's training views without their masks. The images should be small: 160 pixels wide.
  // Stops early when `told` returns false.
  StillScene(const Capture& capture, const TrainOptions& options, int iterations, const StepsDone& told);

  // The appearance in a view.
  struct Look {
    Tensor<float> colour;     // H×W×3
    Tensor<float> agreement;  // H×W, blended over the surfels: the share of photographs that agree
  };
  Look look(const View& view);
  // The points (P×3) beside which there is a surfel that most photographs agree with.
  Tensor<float> standing(const Tensor<float>& points) const;

 private:
  Scene scene_;           // with its colours
  Scene agreement_;       // with the share of agreeing photographs as grey values
  Tensor<float> agreed_;  // M×3, positions of surfels that most photographs agree with
  Renderer renderer_, agreement_renderer_;
};

}  // namespace traceflow

#pragma once

#include <optional>

#include "base/random.h"
#include "capture/capture.h"
#include "scene/neighbours.h"
#include "scene/scene.h"
#include "track/texture_trust.h"
#include "train/camera_refinement.h"
#include "train/density.h"
#include "train/divergence_monitor.h"
#include "train/optimiser.h"

namespace traceflow {

// Draws training views in random order, each view once before any repeats.
class ViewOrder {
 public:
  explicit ViewOrder(int64_t views);
  int32_t draw(Random& random);

  const Tensor<int32_t>& order() const { return order_; }
  int64_t next() const { return next_; }
  void set_state(Tensor<int32_t> order, int64_t next);

 private:
  Tensor<int32_t> order_;
  int64_t next_;
};

// What training has found out about bodies (deform.kind = nodes).
struct BodyState {
  bool at_rest = false;                    // they do not move, and none is tracked
  bool released = false;                   // no surfel belongs to a body any more
  TextureTrust texture_trust;              // during tracking
  std::optional<Mat3<double>> prior_bias;  // of normal priors in masks, if it is corrected
};

// Of each main surfel, in TrainingState::neighbours.
inline constexpr int neighbours_per_surfel = 8;

// The state of a training run between two iterations: everything that decides how it continues, and so what a
// checkpoint holds (train/checkpoint.h).
class TrainingState {
 public:
  // At the start of a run with this scene, which is on the run's device.
  TrainingState(const TrainOptions& options, const Capture& capture, Scene start);

  Scene scene;
  Optimiser optimiser;
  DensityControl main_density, environment_density;
  CameraRefinement cameras;  // of the training views
  ViewOrder views;
  Random random;
  DivergenceMonitor divergence;
  BodyState bodies;
  Neighbours neighbours;  // edges between main surfels, for loss.rigidity; empty until needed
  // Main surfels before this row are at points of the capture. Invented ones and those added during tracking
  // follow.
  int64_t initial_main_count = 0;
  float environment_radius = 1;  // half the diagonal of the environment's initial box
  int iteration = 0;             // done so far
  double seconds = 0;            // of steps and saves, earlier sessions included; listeners do not count

  // Copies what an iteration may change before it applies its gradient. solves_poses: it changes bodies, too.
  void begin_iteration(bool solves_poses);
  // Counts the iteration and drops the copies.
  void end_iteration();
  // Restores the copies if an iteration has begun and not ended, so that it will draw the same again.
  void roll_back();

  // Gives the training views the refined cameras and the correction of their normal priors.
  void apply_to(std::vector<View>& train) const;

 private:
  struct Copies {
    Random random;
    ViewOrder views;
    DivergenceMonitor divergence;
    BodyState bodies;
    // Of an iteration that solves poses.
    std::optional<Motion> motion;
    std::optional<Nodes> nodes;
    std::optional<Lighting> lighting;
    std::optional<Surfels> main;
  };
  std::optional<Copies> before_;
  std::vector<std::optional<Mat3<float>>> given_prior_turns_;  // of the training views
};

}  // namespace traceflow

#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "capture/capture.h"
#include "record/events.h"
#include "render/renderer.h"
#include "scene/run_folder.h"
#include "train/body_training.h"
#include "train/memory.h"
#include "train/objective.h"
#include "train/schedule.h"
#include "train/step_meter.h"
#include "train/targets.h"
#include "train/training_state.h"

namespace traceflow {

// One training run (method §7): the loop over its state, and its checkpoints. Emits events and prints
// nothing.
class Trainer {
 public:
  // Makes the initial scene from the capture and moves it to the device. The run's folder is created with the
  // first checkpoint.
  Trainer(const TrainOptions& options, Capture capture, const std::filesystem::path& run,
          Device device = Device::cpu);

  // Continues from the run's checkpoint; call before run(). Throws InputError when the checkpoint does not
  // fit.
  void resume();

  // Trains until the last iteration, until `stop` is set, until memory runs out or until a photograph can no
  // longer be read, and then saves. There is one exception: if the driver has no memory to start a kernel in
  // the middle of a change to the scene, the previous checkpoint remains. If the disk refuses a checkpoint
  // during training, run() warns and tries again at the next one. Throws InputError when the first or the
  // last checkpoint is refused.
  events::Finished run(const std::atomic<bool>& stop);

  // One iteration of the loop, without saving. Returns the loss.
  LossValues step();

  // Is called with each render, its photograph and the gradient by the render. The callback may set entries
  // of the gradient to zero, so that these pixels do not train the scene.
  using Review = std::function<void(const Frame&, const ViewImages&, FrameGradient&)>;
  void review_gradients(Review review) { review_ = std::move(review); }
  // Makes main surfels transparent, so that density control removes them.
  void fade(std::span<const int64_t> rows);

  // Ends run() after the current iteration. May be called on any thread.
  void stop_soon() { stop_soon_ = true; }
  // Saves the current state. May be called between two iterations, and so by a listener. The previous
  // checkpoint is always sound: while the current checkpoint is of a collapsed state, saving replaces it and
  // keeps the previous.
  void save();

  events::Stream& stream() { return stream_; }
  const Scene& scene() const { return state_.scene; }
  const Capture& capture() const { return capture_; }
  const TrainOptions& options() const { return options_; }
  int iteration() const { return state_.iteration; }

 private:
  // The state at the start of the run.
  TrainingState initial_state();

  // The parts of a step.
  const View& draw_view(bool tracks);
  FrameRequest request_for(const View& view, const ViewImages& target);
  NormalLosses normal_losses(const Trainable& trainable, bool tracks) const;
  // The edges between neighbouring main surfels. Finds them at the first call.
  const Neighbours& neighbours();
  // The part after a finite loss.
  void learn(const View& view, const Frame& frame, const FrameRequest& request, const Trainable& trainable);
  Tensor<Camera<float>> training_cameras() const;  // on device_
  void control_density(const Surfels& new_surface, bool tracks);

  struct End {
    events::Ending ending;
    std::string reason;
  };
  // Iterates until something ends the run.
  End iterate(const std::atomic<bool>& stop);
  // One iteration with its events. Returns what is wrong with its numbers, or an empty string.
  std::string emit_iteration();
  // Undoes an iteration that failed, and frees memory for saving.
  void roll_back();
  // The advice if the fields made the scene diverge.
  std::string collapse_advice() const;

  // Throws NotSaved when save() fails.
  void save_or_throw();
  // Throws NotSaved only if there is no checkpoint yet; later it warns.
  void save_or_warn();

  events::SurfelCounts counts() const {
    return {state_.scene.main.count(), state_.scene.environment.count()};
  }
  void warn(const std::string& text);  // does nothing if it is empty
  void emit_start();
  // Emits the measurements so far, for the phase of the last iteration.
  void emit_measured();
  void emit_density();
  void emit_step(const LossValues& terms, double step_seconds);
  events::Finished finish(const End& end);

  TrainOptions options_;
  Device device_;
  Capture capture_;             // with cameras as refined so far
  std::string views_checksum_;  // of the capture as given
  std::string capture_folder_;  // absolute, like run_, so that the working directory no longer matters
  RunFolder run_;
  // The state of the current checkpoint.
  enum class CheckpointState { none, sound, unsound } checkpoint_state_ = CheckpointState::none;
  Schedule schedule_;
  std::optional<lpips::Network> perceptual_;
  MemoryPlan memory_;
  Targets targets_;
  int64_t points_ = 0, points_in_view_ = 0;  // at the start of the scene
  TrainingState state_;
  float cloud_radius_;  // of the capture's points
  Renderer renderer_;
  SceneGradient gradient_;
  FrameGradient grad_frame_;
  Tensor<float> grad_rest_;  // dL/d(stored positions) by loss.rigidity
  LossMeans means_;
  NonFiniteGradients non_finite_;
  events::Stream stream_;
  BodyTraining bodies_;
  StepMeter meter_;
  std::vector<events::DensityChanged> density_changes_;  // of the step, not emitted yet
  Review review_;
  // An iteration has begun to change the scene and has not finished. Such a state must not be saved.
  bool half_updated_ = false;
  std::atomic<bool> stop_soon_{false};
  double rate_ = 0;  // steps per second, smoothed
};

}  // namespace traceflow

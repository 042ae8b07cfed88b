#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "base/random.h"
#include "capture/capture.h"
#include "record/events.h"
#include "render/renderer.h"
#include "scene/neighbours.h"
#include "scene/run_folder.h"
#include "track/tracker.h"
#include "train/camera_refinement.h"
#include "train/density.h"
#include "train/divergence_monitor.h"
#include "train/initialise.h"
#include "train/memory.h"
#include "train/objective.h"
#include "train/optimiser.h"
#include "train/schedule.h"
#include "train/step_meter.h"
#include "train/targets.h"

namespace traceflow {

// Draws training views in random order, each view once before any repeats.
class ViewOrder {
 public:
  explicit ViewOrder(int64_t views) : order_({views}), next_(views) {
    for (int64_t i = 0; i < views; ++i) order_[i] = static_cast<int32_t>(i);
  }
  int32_t draw(Random& random);

  const Tensor<int32_t>& order() const { return order_; }
  int64_t next() const { return next_; }
  void set_state(Tensor<int32_t> order, int64_t next);

 private:
  Tensor<int32_t> order_;
  int64_t next_;
};

// One training run (method §7): the scene, everything that changes it, and the loop. Emits events and prints
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
  const Scene& scene() const { return scene_; }
  const Capture& capture() const { return capture_; }
  const TrainOptions& options() const { return options_; }
  int iteration() const { return iteration_; }

 private:
  // Stores the counts of the initial scene and returns the scene.
  Scene begin(InitialScene made);
  // The state of tracking (deform.kind = nodes).
  struct Tracking {
    bool goes_on = false;  // tracking has not reached the end of the video
    bool enters = false;   // this iteration starts with a new key
    bool refines = false;  // this iteration starts by solving all poses again, depths fixed
    int64_t key = 0;       // the newest key
  };
  Tracking tracking(int iteration) const;
  Tracker make_tracker() const;
  // Changes the bodies before an iteration trains. Returns surfels for newly visible surface.
  Surfels follow_bodies(const Tracking& now);
  // Tracks the bodies to a new key.
  void follow(int64_t key);
  // A few keys after the first: splits bodies whose parts move separately.
  void part_bodies(int64_t key);
  // Surfels for the surface of bodies that has become visible at the newest key.
  Surfels new_surface(int64_t key) const;
  // Solves the poses of all keys again: at the end of the video, and later as shapes improve.
  void follow_again();
  // Measures the bias of normal priors in masks and corrects it from then on.
  void turn_priors();
  void set_prior_bias(const Mat3<double>& bias);
  // Before tracking the second key: decides whether the masks of all keys fit bodies at rest. If so, no body
  // is tracked and the poses stay at rest.
  void see_whether_bodies_stand();
  // Whether everything trains as soon as bodies are known to stand still, and not only from the end of the
  // video on. Without normal priors, reflections that start so early harm the shape.
  bool skips_following() const;
  // Scales rigid bodies to the size in the first view, if poses are well known, and to the distance of the
  // points. Changes the motion accordingly. main and motion are on the CPU; the scene takes over the surfels
  // but not the motion.
  void keep_sizes(const Tracker& tracker, bool poses_are_known, Surfels& main, Motion& motion);
  // Releases surfels that the views up to this key show to lie behind or beside their body.
  void let_strays_go(int64_t key);
  // Decides, after tracking, what deforms and what else moves.
  void settle();
  // Releases all surfels of bodies that do not fit, so that a field moves everything.
  void let_everything_go();
  // Resets the surfels whose body differs from `carried`. main and carried are on the CPU.
  void begin_anew(const Tensor<int32_t>& carried, Surfels main);
  // Marks surfels outside bodies as static, unless the renders differ much from the photographs there.
  void let_stand();
  // Gives nodes to bodies, so that they can deform, if the silhouette error grows after the first view or if
  // the photographs of a body with trusted texture fit much better with nodes than without.
  void let_bend(const std::vector<double>& misfits);
  // Adds changing light, from then on.
  void let_light_change();
  // Convolves the gradient of poses over neighbouring keys. The first key gets none.
  void share_among_keys();
  // Adds the regularisation of nodes to their gradient. The first time gets none.
  void hold_nodes();

  // The silhouette error of the bodies in a view, as a share of the mask's area; empty without a mask.
  std::optional<double> silhouette_misfit(const View& view);
  // The errors in some views, in the order of time.
  std::vector<double> silhouette_misfits();
  // The colour error in some views, relative to that with the bodies at rest. Both count where bodies are
  // visible in either state.
  double colour_error_over_standing();
  const View& draw_tracked_view(const Tracking& now);
  // The next view among those whose times the schedule has reached.
  const View& draw_view();
  FrameRequest request_for(const View& view);
  NormalLosses normal_losses(const Trainable& trainable, const Tracking& now) const;
  // The edges between neighbouring main surfels. Finds them at the first call.
  const Neighbours& neighbour_edges();
  // Refines the camera of a training view by the gradient of its render.
  void refine_camera(const View& view);
  void set_refined_cameras();
  // The part of a step after a finite loss.
  void learn(const View& view, const Frame& frame, const FrameRequest& request, const Trainable& trainable);
  void control_density(int done, const Surfels& new_surface);
  void emit_start();
  void warn(const std::string& text) { stream_.emit(events::Warning{iteration_, text}); }
  void keep_caps(const Safetensors& file);
  // Emits the measurements so far, for the phase of the last iteration.
  void emit_measured();
  void emit_density();
  struct End {
    events::Ending ending;
    std::string reason;
  };
  // Iterates until something ends the run.
  End iterate(const std::atomic<bool>& stop);
  // One iteration with its events. Returns what is wrong with its numbers, or an empty string.
  std::string emit_iteration();
  // The advice after running out of memory.
  std::string when_there_is_room() const;
  // The advice if the fields made the scene diverge.
  std::string collapse_advice() const;
  // Throw NotSaved when save() fails; save_on_the_way only if there is no checkpoint yet.
  void save_or_say_why_not();
  void save_on_the_way();
  // The state before a step, which the step draws from or changes.
  struct Draws {
    Random random;
    ViewOrder views;
    int iteration;
    // The values before the step, if it solves poses.
    std::optional<Motion> motion;
    std::optional<Nodes> nodes;
    std::optional<Lighting> lighting;
    std::optional<Surfels> main;
    TextureTrust texture_trust;
    bool bodies_stand = false;
  };
  // Prepares for saving after a failed step: an incomplete iteration will draw the same again.
  void rollback_draws();
  Safetensors checkpoint() const;
  events::SurfelCounts counts() const { return {scene_.main.count(), scene_.environment.count()}; }
  events::Step step_event(const LossValues& terms, double step_seconds);
  events::Finished finish(events::Ending ending, const std::string& reason);

  TrainOptions options_;
  Device device_;
  Capture capture_;
  std::string views_checksum_;  // of the capture as given
  CameraRefinement cameras_;    // of the training views; their cameras are stored refined
  std::string capture_folder_;  // absolute, like run_, so that the working directory no longer matters
  RunFolder run_;
  // The state of the current checkpoint.
  enum class CheckpointState { none, sound, unsound } checkpoint_state_ = CheckpointState::none;
  Schedule schedule_;
  std::optional<lpips::Network> perceptual_;
  Random random_;
  MemoryPlan memory_;
  Targets targets_;
  int64_t points_ = 0, points_in_view_ = 0;  // at the start of the scene
  // Main surfels before this row are at points of the capture. Invented ones and those added during tracking
  // follow.
  int64_t initial_main_count_ = 0;
  bool carries_ = true;        // bodies have surfels
  bool bodies_stand_ = false;  // and none is tracked
  Scene scene_;
  Optimiser optimiser_;
  DensityControl main_density_, environment_density_;
  static constexpr int neighbours_each = 8;  // of a surfel
  Neighbours neighbour_edges_;               // of main surfels, for loss.rigidity; empty until needed
  Tensor<float> grad_rest_;                  // dL/d(stored positions) of that term
  float cloud_radius_;                       // of the capture's points
  float environment_radius_;                 // half the diagonal of the environment's initial box
  ViewOrder views_;
  DivergenceMonitor divergence_;
  Renderer renderer_;
  SceneGradient gradient_;
  FrameGradient grad_frame_;
  LossMeans means_;
  NonFiniteGradients non_finite_;
  events::Stream stream_;
  StepMeter meter_;
  std::vector<events::DensityChanged> density_changes_;  // of the step, not emitted yet
  Draws before_step_;
  Review review_;
  TextureTrust texture_trust_;              // during tracking
  std::optional<Mat3<double>> prior_bias_;  // of normal priors in masks, if it is corrected
  // An iteration has begun to change the scene and has not finished. Such a state must not be saved.
  bool torn_ = false;
  std::atomic<bool> stop_soon_{false};
  int iteration_ = 0;   // done so far
  double seconds_ = 0;  // of steps and saves, earlier sessions included; listeners do not count
  double rate_ = 0;     // steps per second, smoothed
};

}  // namespace traceflow

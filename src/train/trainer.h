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

// Draws training views in random order, each once before any comes again.
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
  // Starts a scene from the capture and takes it to the device. The run's folder is made when the first
  // checkpoint is saved.
  Trainer(const TrainOptions& options, Capture capture, const std::filesystem::path& run,
          Device device = Device::cpu);

  // Continues from the run's checkpoint; call before run(). Throws InputError when it does not fit.
  void resume();

  // Trains to the last iteration, until `stop` is set, until memory runs out or until a photograph can no
  // longer be read; saves in every case but one: where the driver has no memory to start a kernel amid a
  // change of the scene, the checkpoint before stands. A save on the way that the disk refuses is a warning,
  // and tried again at the next; throws InputError when the first or the last one is refused.
  events::Finished run(const std::atomic<bool>& stop);

  // One iteration of the loop, without saving; returns the loss.
  LossValues step();

  // Is called with each picture, its photograph and the gradient by the picture: what it sets to zero teaches
  // nothing.
  using Review = std::function<void(const Frame&, const ViewImages&, FrameGradient&)>;
  void review_gradients(Review review) { review_ = std::move(review); }
  // Makes main surfels transparent: density control removes them.
  void fade(std::span<const int64_t> rows);

  // Ends run() after the iteration that goes on. On any thread.
  void stop_soon() { stop_soon_ = true; }
  // Saves what stands. May be called between two iterations, so by a listener. The checkpoint before the
  // current one is always sound: a run that collapses drops its own.
  void save();

  events::Stream& stream() { return stream_; }
  const Scene& scene() const { return scene_; }
  const Capture& capture() const { return capture_; }
  const TrainOptions& options() const { return options_; }
  int iteration() const { return iteration_; }

 private:
  // Takes over what is told of the scene that the run starts from.
  Scene begin(InitialScene made);
  // Where the run is while bodies are tracked (deform.kind = nodes).
  struct Tracking {
    bool goes_on = false;  // the film has not been followed to its end
    bool enters = false;   // this iteration begins with a new time
    bool refines = false;  // this iteration begins with all poses solved again, depths held
    int64_t key = 0;       // the newest time
  };
  Tracking tracking(int iteration) const;
  Tracker make_tracker() const;
  // What an iteration does to bodies before it trains. Returns surfels for surface that has come into view.
  Surfels follow_bodies(const Tracking& now);
  // Follows bodies to a new time.
  void follow(int64_t key);
  // Some times after the first: what moves apart becomes several bodies.
  void part_bodies(int64_t key);
  // Surfels for surface of bodies that has come into view at the newest time.
  Surfels new_surface(int64_t key) const;
  // Finds the poses of all times again: when the film has been followed to its end, and after that as shapes
  // get better.
  void follow_again();
  // Measures the bias of normal priors in masks, and undoes it from then on.
  void turn_priors();
  void set_prior_bias(const Mat3<double>& bias);
  // Before the second time is followed: whether the masks of all times fit bodies that stand still. Then none
  // is followed, and their poses stay at rest.
  void see_whether_bodies_stand();
  // Whether everything trains as soon as bodies are known to stand, and not from the film's end on. Without
  // normal priors reflections that begin so early harm the shape.
  bool skips_following() const;
  // Makes rigid bodies as large as the first picture shows them, where poses are known well, and puts them as
  // far away as the points are; and the motion what fits. Everything on the CPU; the scene takes it over, all
  // but the motion.
  void keep_sizes(const Tracker& tracker, bool poses_are_known, Surfels& main, Motion& motion);
  // What lies behind a body may have been taken for a part of it: the times up to this one tell.
  void let_strays_go(int64_t key);
  // What bodies become when the film has been followed.
  void settle();
  // Bodies that do not fit carry nothing: a field moves all that moves.
  void let_everything_go();
  // Makes a beginning of the surfels that are no longer carried as `carried` says. Everything on the CPU.
  void begin_anew(const Tensor<int32_t>& carried, Surfels main);
  // What no body carries stands still, unless the pictures are far from the photographs there.
  void let_stand();
  // Gives bodies nodes, so that they may bend, where silhouettes get worse after the first time, or where
  // photographs of a body whose texture is trusted match much better with nodes than without.
  void let_bend(const std::vector<double>& misfits);
  // From then on the light on what stands still may change.
  void let_light_change();
  // Spreads the gradient of poses over times that are near; none at the first.
  void share_among_keys();
  // Adds to the nodes' gradient what holds them together, and none at the first time.
  void hold_nodes();

  // How far the bodies' silhouettes are off in a view, as a share of the mask's area; none without a mask.
  std::optional<double> silhouette_misfit(const View& view);
  // In some views, in the order of time.
  std::vector<double> silhouette_misfits();
  // What the colours are off by in some views, over what they are off by while the bodies stand where they
  // began; both where bodies are seen, moving or standing.
  double colour_error_over_standing();
  const View& draw_tracked_view(const Tracking& now);
  // The next view among those whose times the schedule has reached.
  const View& draw_view();
  FrameRequest request_for(const View& view);
  NormalLosses normal_losses(const Trainable& trainable, const Tracking& now) const;
  // Add the terms on the main surfels' rigidity (loss.rigidity) and on what the environment's field adds
  // (loss.environment_residual), with their gradients.
  // The edges between neighbouring main surfels, found when they are first needed.
  const Neighbours& neighbour_edges();
  // Refines the camera of a training view by the gradient of its picture.
  void refine_camera(const View& view);
  void set_refined_cameras();
  // Everything of a step that follows a loss that is a number.
  void learn(const View& view, const Frame& frame, const FrameRequest& request, const Trainable& trainable);
  void control_density(int done, const Surfels& new_surface);
  void tell_start();
  void warn(const std::string& text) { stream_.emit(events::Warning{iteration_, text}); }
  void keep_caps(const Safetensors& file);
  // Tells what was measured up to here, in the phase of the last iteration.
  void tell_measured();
  void tell_density();
  struct End {
    events::Ending ending;
    std::string reason;
  };
  // Iterations until something ends them.
  End iterate(const std::atomic<bool>& stop);
  // One of them, with what is told of it; what is wrong with its numbers, or nothing.
  std::string tell_iteration();
  // What to do about memory that ran out.
  std::string when_there_is_room() const;
  // What to try where the fields made the scene fly apart.
  std::string collapse_advice() const;
  // Throw NotSaved where save() fails, the second only where no checkpoint stands.
  void save_or_say_why_not();
  void save_on_the_way();
  // What a step draws from.
  struct Draws {
    Random random;
    ViewOrder views;
    int iteration;
    // As the step found them, where it solves poses.
    std::optional<Motion> motion;
    std::optional<Nodes> nodes;
    std::optional<Lighting> lighting;
    std::optional<Surfels> main;
    TextureTrust texture_trust;
    bool bodies_stand = false;
  };
  // Makes ready to save after a step that failed: an iteration that did not come to its end draws the same
  // again.
  void rollback_draws();
  Safetensors checkpoint() const;
  events::SurfelCounts counts() const { return {scene_.main.count(), scene_.environment.count()}; }
  events::Step step_event(const LossValues& terms, double step_seconds);
  events::Finished finish(events::Ending ending, const std::string& reason);

  TrainOptions options_;
  Device device_;
  Capture capture_;
  std::string views_checksum_;  // of the capture as it was given
  CameraRefinement cameras_;    // of its training views, whose cameras are kept as refined
  std::string capture_folder_;  // whole paths both, so that neither needs the working directory again
  RunFolder run_;
  // Of the current checkpoint.
  enum class CheckpointState { none, sound, unsound } checkpoint_state_ = CheckpointState::none;
  Schedule schedule_;
  std::optional<lpips::Network> perceptual_;
  Random random_;
  MemoryPlan memory_;
  Targets targets_;
  int64_t points_ = 0, points_in_view_ = 0;  // that the scene began with
  // Main surfels at these points; those made up, or added while bodies are followed, come after.
  int64_t initial_main_count_ = 0;
  bool carries_ = true;        // bodies carry something
  bool bodies_stand_ = false;  // and none is followed
  Scene scene_;
  Optimiser optimiser_;
  DensityControl main_density_, environment_density_;
  static constexpr int neighbours_each = 8;  // of a surfel
  Neighbours neighbour_edges_;               // of the main surfels, for loss.rigidity; empty until wanted
  Tensor<float> grad_rest_;                  // dL/d(stored positions) of that term
  float cloud_radius_;                       // of the capture's points
  float environment_radius_;                 // half the diagonal of the box that the environment began in
  ViewOrder views_;
  DivergenceMonitor divergence_;
  Renderer renderer_;
  SceneGradient gradient_;
  FrameGradient grad_frame_;
  LossMeans means_;
  NonFiniteGradients non_finite_;
  events::Stream stream_;
  StepMeter meter_;
  std::vector<events::DensityChanged> density_changes_;  // of the step, not told yet
  Draws before_step_;
  Review review_;
  TextureTrust texture_trust_;              // while bodies are followed
  std::optional<Mat3<double>> prior_bias_;  // of normal priors in masks, where it is undone
  // Whether an iteration has begun to change the scene and not come to the end of it: such a state is none.
  bool torn_ = false;
  std::atomic<bool> stop_soon_{false};
  int iteration_ = 0;   // done so far
  double seconds_ = 0;  // of steps and saves, earlier sessions included; listeners may take their time
  double rate_ = 0;     // steps a second, smoothed
};

}  // namespace traceflow

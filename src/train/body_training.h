#pragma once

#include "record/events.h"
#include "render/renderer.h"
#include "track/tracker.h"
#include "train/schedule.h"
#include "train/training_state.h"

namespace traceflow {

// What bodies do during training (deform.kind = nodes; docs/bodies.md). They are tracked from key to key. At
// the end of the video, or as soon as they are known to be at rest, it is decided what of them trains.
// Without bodies all of this does nothing. Holds references to what it is made from.
class BodyTraining {
 public:
  BodyTraining(const TrainOptions& options, const Schedule& schedule, Capture& capture, TrainingState& state,
               Renderer& renderer, events::Stream& stream)
      : options_(options),
        schedule_(schedule),
        capture_(capture),
        state_(state),
        renderer_(renderer),
        stream_(stream) {}

  // What the state's iteration does.
  struct Step {
    bool tracks = false;   // the end of the video is not reached
    bool new_key = false;  // it begins with a new key
    bool refines = false;  // it begins by solving all poses again, depths fixed
    int64_t key = 0;       // the newest
    bool solves_poses() const { return new_key || refines; }
  };
  Step step() const;

  // Changes the bodies before the iteration trains. Returns surfels for newly visible surface, so that there
  // are at most max_main.
  Surfels update(int64_t max_main);
  // A training view for an iteration that tracks.
  const View& draw_view();
  // Sets what of the bodies the iteration trains. While it tracks, it renders no reflections and trains
  // little else.
  void configure(FrameRequest& request, Trainable& trainable) const;
  // Constrains the gradient of the bodies, and adds the regularisation of nodes and light.
  void constrain(const Trainable& trainable, SceneGradient& gradient) const;

 private:
  // Whether everything trains as soon as bodies are known to be at rest, and not only from the end of the
  // video on. Without normal priors, reflections that start so early harm the shape.
  bool skips_tracking() const { return state_.bodies.at_rest && capture_.has_normal_priors; }
  bool solves() const { return !options_.deform.track.true_poses && !state_.bodies.at_rest; }
  Tracker tracker() const;

  // Before the second key: decides whether the masks of all keys fit bodies at rest. If so, none is tracked.
  void decide_at_rest();
  // Solves the poses of a new key.
  void track_key(int64_t key);
  // A few keys after the first: splits bodies whose parts move separately.
  void split_bodies(int64_t key);
  Surfels new_surface(int64_t key, int64_t max_main) const;
  // Solves the poses of all keys again: at the end of the video, and later as shapes improve.
  void solve_all_keys(bool refines);
  // Scales rigid bodies to the size in the first view, if poses are well known (refines), and to the distance
  // of the points. Changes the motion accordingly. main and motion are on the CPU; the scene takes over the
  // surfels but not the motion.
  void correct_sizes(const Tracker& tracker, bool refines, Surfels& main, Motion& motion);
  // Measures the bias of normal priors in masks and corrects it from then on.
  void correct_priors();
  // Releases surfels that the views up to this key show to lie behind or beside their body.
  void release_outliers(int64_t key);
  // Releases all surfels, so that a field moves everything.
  void release_all();
  // Sets the body of each main surfel, on the CPU, and resets the surfels that are released.
  void set_bodies(const Tensor<int32_t>& body);

  // After tracking: decides what deforms and what else moves.
  void finish_tracking();
  // Marks surfels outside bodies as static, unless the renders differ much from the photographs there.
  void freeze_background();
  // Gives nodes to bodies, so that they can deform, if the silhouette error grows after the first view or if
  // the photographs of a body with trusted texture fit much better with nodes than without.
  void enable_bending(const std::vector<double>& silhouette_errors);
  // Adds changing light, from then on.
  void enable_lighting();

  const TrainOptions& options_;
  const Schedule& schedule_;
  Capture& capture_;
  TrainingState& state_;
  Renderer& renderer_;
  events::Stream& stream_;
};

}  // namespace traceflow

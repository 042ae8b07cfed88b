#pragma once

#include "render/frame.h"
#include "train/options.h"

namespace traceflow {

// The phase of training (method §7.1–§7.3).
enum class Phase { diffuse, specular, joint };
const char* to_string(Phase phase);

// What density control does to a set after so many iterations.
struct DensityStep {
  bool densifies;  // clones, splits and prunes
  bool prunes_large;
  // After a reset, opacities recover for as many iterations as lie between two density controls of a
  // full-length run: a shorter run has more frequent controls, but its optimiser is not faster. There are no
  // resets if they would follow each other within twice that.
  bool prunes_faint;
  bool resets_opacity;
};

// What an iteration of a run does (method §7): the options' iteration numbers scaled to the run's length.
// Iterations count from 0.
class Schedule {
 public:
  explicit Schedule(const TrainOptions& options) : options_(options) {}

  Phase phase(int iteration) const;
  Trainable trainable(int iteration) const;
  bool deforms_main(int iteration) const;
  bool deforms_environment(int iteration) const;
  bool uses_normal_losses(int iteration) const;
  // From 1 at the start linearly to 0 at loss.depth_prior_until: priors guide the shape, and photographs
  // decide it.
  double depth_prior_share(int iteration) const;
  bool uses_lpips(int iteration) const;
  // The number along each side of a pixel (RenderOptions).
  int samples(int iteration) const;
  // The render options with the iteration's number of samples.
  RenderOptions render(int iteration) const;
  int sh_degree_main(int iteration) const;
  int sh_degree_environment(int iteration) const;
  // The standard deviation of the noise on the time (method §7.6), in frame intervals.
  double time_jitter(int iteration) const;
  // The latest time of the views in use, for a capture from `first` to `last`. It grows gradually, so that
  // motion is learnt starting from the initial surfels instead of over the whole capture at once.
  double latest_time(int iteration, double first, double last) const;

  // Whether all poses are solved again before this iteration. followed: the iteration at which tracking
  // reached the end of the video. Poses that train drift away, the farther the longer they are not solved.
  bool solves_poses_again(int iteration, int64_t followed) const;

  // Density control leaves the environment alone until that has trained.
  DensityStep main_density(int iteration) const;
  DensityStep environment_density(int iteration) const;

  // Learning rates that fall over the run.
  double position_rate(int iteration) const;
  double field_rate(int iteration) const;
  // For poses: log-linear over the run or 8,000 iterations, whichever is shorter, and falling at the same
  // pace beyond. Poses with a high rate for longer drift away together with their surfels.
  double motion_rate(int iteration) const;
  double map_rate(int iteration) const;
  double camera_rate(int iteration) const;

 private:
  // An iteration number of the schedule, scaled to this run.
  int mark(int in_schedule) const;
  // A scaled interval, at least one iteration.
  int interval(int in_schedule) const;
  // frozen: the phase in which opacities are not reset.
  DensityStep density(int iteration, const DensityOptions& density, Phase frozen) const;
  int sh_degree(int iteration, int start, int limit) const;
  bool specular() const { return options_.specular != Specular::none; }

  TrainOptions options_;
};

// The parts of the scene that a render after so many iterations shows: those that the last iteration trained
// with. In a run that was stopped early, other parts have never trained.
FrameRequest picture_request(const TrainOptions& options, int64_t iterations);
// The matching render options.
RenderOptions picture_render(const TrainOptions& options, int64_t iterations);

}  // namespace traceflow

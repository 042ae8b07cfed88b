#pragma once

#include "render/frame.h"
#include "train/options.h"

namespace traceflow {

// Which part of the method is training (method §7.1–§7.3).
enum class Phase { diffuse, specular, joint };
const char* to_string(Phase phase);

// What an iteration of a run does (method §7): the options' marks scaled to the run's length. Iterations
// count from 0.
class Schedule {
 public:
  explicit Schedule(const TrainOptions& options) : options_(options) {}

  Phase phase(int iteration) const;
  Trainable trainable(int iteration) const;
  bool deforms_main(int iteration) const;
  bool deforms_environment(int iteration) const;
  bool uses_normal_losses(int iteration) const;
  bool uses_lpips(int iteration) const;
  // Along each side of a pixel (RenderOptions).
  int samples(int iteration) const;
  // The options' own, with the samples of the iteration.
  RenderOptions render(int iteration) const;
  int sh_degree_main(int iteration) const;
  int sh_degree_environment(int iteration) const;
  // Standard deviation of the noise on the time (method §7.6), in frame intervals.
  double time_jitter(int iteration) const;
  // The latest time, of a capture's from `first` to `last`, whose views are trained on: motion is followed
  // from where the surfels start, a little further at a time, instead of being found across the whole capture
  // at once.
  double latest_time(int iteration, double first, double last) const;

  // Whether all poses are solved again before this iteration. followed: the iteration at which bodies had
  // been followed to the film's end. Poses that train drift away, the farther the longer they are not solved.
  bool solves_poses_again(int iteration, int64_t followed) const;

  // What is done to a set after so many iterations. The environment is left alone until it has trained.
  bool densifies_main(int iteration) const;
  bool densifies_environment(int iteration) const;
  bool prunes_large_main(int iteration) const;
  bool prunes_large_environment(int iteration) const;
  // Opacities that were reset have so many iterations to recover as lie between two density controls of a run
  // of full length: a shorter one has more controls, and the optimiser is not faster for it. Where resets
  // would follow each other before twice that, there are none.
  bool prunes_faint_main(int iteration) const;
  bool prunes_faint_environment(int iteration) const;
  bool resets_main_opacity(int iteration) const;
  bool resets_environment_opacity(int iteration) const;

  // Learning rates that fall along the run.
  double position_rate(int iteration) const;
  double field_rate(int iteration) const;
  // Of poses: log-linear over the run or 8,000 iterations, whichever is shorter, and on beyond. Poses that
  // keep a high rate for longer drift away with the surfels that they carry.
  double motion_rate(int iteration) const;
  double map_rate(int iteration) const;
  double camera_rate(int iteration) const;

 private:
  // A mark of the schedule in iterations of this run.
  int mark(int in_schedule) const;
  // Iterations from one event to the next, at least one.
  int interval(int in_schedule) const;
  bool densifies(int iteration, const DensityOptions& density) const;
  bool resets(int iteration, const DensityOptions& density) const;
  // The last multiple of the interval of resets before an iteration.
  int last_reset(int iteration, const DensityOptions& density) const;
  bool has_recovered(int iteration, int reset, const DensityOptions& density) const;
  int sh_degree(int iteration, int start, int limit) const;
  bool specular() const { return options_.specular != Specular::none; }

  TrainOptions options_;
};

// The parts of the scene that take part in a picture after so many iterations: those that the last one
// trained with. A run stopped early has parts that never saw a photograph.
FrameRequest picture_request(const TrainOptions& options, int64_t iterations);
// And how they are drawn.
RenderOptions picture_render(const TrainOptions& options, int64_t iterations);

}  // namespace traceflow

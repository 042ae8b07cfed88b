#include "train/schedule.h"

#include <algorithm>
#include <cmath>

namespace traceflow {

const char* to_string(Phase phase) {
  switch (phase) {
    case Phase::diffuse:
      return "diffuse";
    case Phase::specular:
      return "specular";
    case Phase::joint:
      return "joint";
  }
  return "";
}

int Schedule::mark(int in_schedule) const {
  return static_cast<int>(
      std::llround(static_cast<double>(in_schedule) * options_.iterations / options_.schedule.length));
}

int Schedule::interval(int in_schedule) const { return std::max(1, mark(in_schedule)); }

Phase Schedule::phase(int iteration) const {
  // Without reflections there is nothing for phases 2 and 3 to add.
  if (!specular() || iteration < mark(options_.schedule.specular_from)) return Phase::diffuse;
  return iteration < mark(options_.schedule.joint_from) ? Phase::specular : Phase::joint;
}

Trainable Schedule::trainable(int iteration) const {
  const Phase now = phase(iteration);
  Trainable t;
  t.main = now != Phase::specular;
  t.main_field = t.main && deforms_main(iteration);
  t.tint = now != Phase::diffuse;
  t.environment = now != Phase::diffuse;
  t.environment_field = deforms_environment(iteration);
  t.camera = t.main && options_.rates.camera > 0;
  return t;
}

bool Schedule::deforms_main(int iteration) const {
  return options_.deform.main && iteration >= mark(options_.schedule.deform_from);
}

bool Schedule::deforms_environment(int iteration) const {
  return options_.deform.environment && phase(iteration) != Phase::diffuse;
}

bool Schedule::uses_normal_losses(int iteration) const {
  return iteration >= mark(options_.schedule.normal_from);
}

double Schedule::depth_prior_share(int iteration) const {
  return std::max(0.0, 1 - static_cast<double>(iteration) / interval(options_.loss.depth_prior_until));
}

bool Schedule::uses_lpips(int iteration) const {
  return options_.loss.lpips > 0 && iteration >= mark(options_.loss.lpips_from);
}

int Schedule::samples(int iteration) const {
  return iteration >= mark(options_.schedule.samples_from) ? options_.render.samples : 1;
}

RenderOptions Schedule::render(int iteration) const {
  RenderOptions render = options_.render;
  render.samples = samples(iteration);
  return render;
}

int Schedule::sh_degree(int iteration, int start, int limit) const {
  return std::clamp((iteration - start) / interval(options_.schedule.sh_every), 0, limit);
}

int Schedule::sh_degree_main(int iteration) const {
  return sh_degree(iteration, 0, options_.initial.sh_degree);
}

int Schedule::sh_degree_environment(int iteration) const {
  return sh_degree(iteration, mark(options_.schedule.specular_from), options_.initial.environment_sh_degree);
}

double Schedule::time_jitter(int iteration) const {
  const int until = mark(options_.schedule.time_jitter_until);
  if (iteration >= until) return 0;
  return options_.schedule.time_jitter * (1.0 - static_cast<double>(iteration) / until);
}

double Schedule::latest_time(int iteration, double first, double last) const {
  const int from = mark(options_.schedule.deform_from);
  const int until = mark(options_.schedule.all_times_from);
  if (iteration >= until) return last;
  const double grown = static_cast<double>(std::max(0, iteration - from)) / std::max(1, until - from);
  return std::lerp(first, last, std::lerp(static_cast<double>(options_.schedule.first_times), 1.0, grown));
}

bool Schedule::solves_poses_again(int iteration, int64_t followed) const {
  constexpr int longest = 2000;
  const int rounds = options_.deform.track.rounds;
  if (rounds == 0) return false;
  const int part = std::clamp(options_.iterations / rounds, 1, longest);
  // Soon after tracking, solving again would not improve poses.
  return iteration % part == 0 && 2 * (iteration - followed) >= part;
}

DensityStep Schedule::density(int iteration, const DensityOptions& density, Phase frozen) const {
  const int every = interval(density.opacity_reset_every);
  const auto is_within = [&](int at) {
    return at > 0 && at >= mark(density.from) && at < mark(density.until);
  };
  const auto resets = [&](int at) {
    return density.opacity_reset_every > 0 && every / 2 >= density.every && is_within(at) &&
           at > mark(density.from) && at % every == 0 && phase(at) != frozen;
  };
  const int last_reset = (iteration - 1) / every * every;
  return {.densifies = is_within(iteration) && iteration % interval(density.every) == 0,
          .prunes_large = iteration > mark(density.prune_above_from),
          .prunes_faint = !resets(last_reset) || iteration - last_reset >= density.every,
          .resets_opacity = resets(iteration)};
}

DensityStep Schedule::main_density(int iteration) const {
  DensityStep step = density(iteration, options_.density, Phase::specular);
  step.densifies = step.densifies && phase(iteration) != Phase::specular;
  return step;
}

DensityStep Schedule::environment_density(int iteration) const {
  DensityStep step = density(iteration, options_.environment_density, Phase::diffuse);
  step.densifies = step.densifies && phase(iteration - 1) != Phase::diffuse;
  return step;
}

double Schedule::position_rate(int iteration) const {
  return optimize::log_linear(options_.rates.position, options_.rates.position_end, iteration,
                              options_.iterations);
}

double Schedule::field_rate(int iteration) const {
  return optimize::log_linear(options_.rates.field, options_.rates.field_end, iteration, options_.iterations);
}

double Schedule::motion_rate(int iteration) const {
  const RateOptions& rates = options_.rates;
  constexpr int longest = 8000;
  const int falls_in = std::min(options_.iterations, longest);
  const double beyond = static_cast<double>(std::max(0, iteration - falls_in)) / falls_in;
  return optimize::log_linear(rates.motion, rates.motion_end, iteration, falls_in) *
         std::pow(rates.motion_end / rates.motion, beyond);
}

double Schedule::camera_rate(int iteration) const {
  constexpr double last = 0.01;
  return optimize::log_linear(options_.rates.camera, last * options_.rates.camera, iteration,
                              options_.iterations);
}

double Schedule::map_rate(int iteration) const {
  return optimize::log_linear(options_.rates.map, options_.rates.map_end, iteration, options_.iterations);
}

namespace {

int last_of(int64_t iterations) { return static_cast<int>(std::max<int64_t>(0, iterations - 1)); }

}  // namespace

FrameRequest picture_request(const TrainOptions& options, int64_t iterations) {
  const Schedule schedule(options);
  const int last = last_of(iterations);
  FrameRequest request;
  request.sh_degree_main = schedule.sh_degree_main(last);
  request.sh_degree_environment = schedule.sh_degree_environment(last);
  request.deform_main = schedule.deforms_main(last);
  request.deform_environment = schedule.deforms_environment(last);
  request.specular = schedule.phase(last) != Phase::diffuse;
  return request;
}

RenderOptions picture_render(const TrainOptions& options, int64_t iterations) {
  return Schedule(options).render(last_of(iterations));
}

}  // namespace traceflow

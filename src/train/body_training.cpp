#include "train/body_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "math/activation.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "track/bodies.h"
#include "track/rescale.h"
#include "train/body_fit.h"
#include "train/initialise.h"

namespace traceflow {

namespace {

// For keys that were solved before: fewer steps and less blur.
constexpr int few_steps = 3;
constexpr double little_blur = 0.35;

// Bodies are released if they exceed both: the silhouette error relative to the area of found masks, and the
// colour error relative to that of bodies at rest.
constexpr double most_silhouette_error = 1.0 / 3, most_colour_error = 0.8;

double mean_of(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// The motion with the poses of this key at all later keys.
Motion constant_after(int64_t key, Motion motion) {
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    for (int64_t later = key + 1; later < motion.keys(); ++later) {
      std::copy_n(&motion.rotation(b, key, 0), 4, &motion.rotation(b, later, 0));
      std::copy_n(&motion.shift(b, key, 0), 3, &motion.shift(b, later, 0));
    }
  }
  return motion;
}

}  // namespace

BodyTraining::Step BodyTraining::step() const {
  if (!state_.scene.main_motion) return {};
  const TrackOptions& track = options_.deform.track;
  constexpr int least_share = 8;  // of a run: limits the warm-up
  const int64_t keys = state_.scene.main_motion->keys();
  const int iteration = state_.iteration;
  const int warm_up = std::min(track.warm_up, options_.iterations / least_share);
  const int since = iteration - warm_up;
  if (since < 0) return {.tracks = true};
  if (skips_tracking()) return {.refines = schedule_.solves_poses_again(iteration, warm_up), .key = keys - 1};
  const bool has_new_key = since % track.map_each == 0;
  const int64_t key = 1 + since / track.map_each;
  if (key < keys) return {.tracks = true, .new_key = has_new_key, .key = key};
  if (key == keys && has_new_key) return {.new_key = true, .key = keys - 1};
  return {.refines = schedule_.solves_poses_again(iteration, warm_up + (keys - 1) * track.map_each),
          .key = keys - 1};
}

Surfels BodyTraining::update(int64_t max_main) {
  constexpr int64_t keys_per_release = 5;
  const Step now = step();
  if (now.new_key && now.key == 1) decide_at_rest();
  if (now.new_key && now.key == 1 && skips_tracking()) {
    state_.divergence.expect_fall();
    release_outliers(state_.scene.main_motion->keys() - 1);
    finish_tracking();
    return {};
  }
  Surfels made;
  if (now.new_key && now.tracks) {
    track_key(now.key);
    split_bodies(now.key);
    if (options_.deform.track.new_surface) made = new_surface(now.key, max_main);
  }
  const bool ends = now.new_key && !now.tracks;
  const bool refines = now.refines && !state_.bodies.released;
  if (refines || ends) solve_all_keys(refines);
  if (refines) correct_priors();
  if (ends || (now.new_key && now.key % keys_per_release == 0)) release_outliers(now.key);
  if (ends) finish_tracking();
  return made;
}

const View& BodyTraining::draw_view() {
  // Many views are of the first key, whose points determine the size of a body, and of the newest keys, whose
  // surface is the least known.
  constexpr double first_share = 0.3, newest_share = 0.35;
  constexpr float newest_duration = 0.08F;
  Random& random = state_.random;
  const int64_t key = step().key;
  const Tensor<float> times = state_.scene.main_motion->time.on(Device::cpu);
  const float latest = times[key];
  const auto draw_between = [&](float from, float to) -> const View& {
    std::vector<const View*> views;
    for (const View& view : capture_.train) {
      if (view.time >= from && view.time <= to) views.push_back(&view);
    }
    return *views[random.below(static_cast<int64_t>(views.size()))];
  };
  const double share = key > 0 ? random.uniform() : 1;
  if (share < first_share) return draw_between(times[0], times[0]);
  if (share < first_share + newest_share) return draw_between(latest - newest_duration, latest);
  for (;;) {
    const View& view = capture_.train[static_cast<size_t>(state_.views.draw(random))];
    if (view.time <= latest) return view;
  }
}

void BodyTraining::configure(FrameRequest& request, Trainable& trainable) const {
  const Scene& scene = state_.scene;
  const bool tracks = step().tracks;
  const bool trains = trainable.main && scene.main_motion && !tracks;
  trainable.main_motion = trains && solves();
  trainable.main_nodes = trains && scene.main_nodes;
  trainable.lighting = trains && scene.lighting;
  if (!tracks) return;
  // Gradients through reflections suppress the rotation of a body.
  request.specular = false;
  request.deform_main = false;
  trainable.main = true;
  trainable.main_field = false;
  trainable.tint = trainable.environment = trainable.environment_field = false;
  trainable.camera = false;
}

void BodyTraining::constrain(const Trainable& trainable, SceneGradient& gradient) const {
  const Scene& scene = state_.scene;
  const DeformOptions& deform = options_.deform;
  if (trainable.main_motion) {
    // Pose errors extend over many keys, but a view has a gradient only for its own key.
    constexpr float widest = 4;  // keys
    constexpr float share_of_video = 0.05F;
    Motion& poses = gradient.main_motion;
    const float width = std::min(widest, share_of_video * static_cast<float>(poses.keys()));
    motion::spread_over_keys(*scene.main_motion, width, poses);
    motion::hold_first_key(poses);
  }
  if (trainable.main_nodes) {
    nodes::resist(*scene.main_nodes, *scene.main_motion,
                  {deform.bend.strain, deform.bend.haste, deform.bend.travel}, gradient.main_nodes);
    nodes::hold_first(gradient.main_nodes);
  }
  if (trainable.lighting) {
    const LightingOptions& light = deform.lighting;
    lighting::resist(*scene.lighting, {light.size, light.haste, light.roughness}, gradient.lighting);
  }
  // Only of the initial surfels: newly added ones that are wrong may fade.
  if (step().tracks) motion::hold_opacities(scene.main.body, state_.initial_main_count, gradient.main);
}

Tracker BodyTraining::tracker() const {
  return {options_.deform.track, schedule_.render(state_.iteration), capture_};
}

void BodyTraining::decide_at_rest() {
  if (options_.deform.track.true_poses) return;
  const std::vector<double> errors = silhouette_errors(capture_, state_.scene, renderer_);
  if (errors.empty()) return;
  const double error = mean_of(errors);
  state_.bodies.at_rest = error < options_.deform.track.still;
  stream_.emit(events::FollowingDecided{state_.iteration, !state_.bodies.at_rest, error});
}

void BodyTraining::track_key(int64_t key) {
  state_.divergence.expect_fall();
  if (!solves()) return;
  const Scene& scene = state_.scene;
  TextureTrust& trust = state_.bodies.texture_trust;
  const Surfels main = scene.main.on(Device::cpu);
  Motion motion = scene.main_motion->on(Device::cpu);
  const TrackOptions& track = options_.deform.track;
  const Tracker tracker = this->tracker();
  const auto solve = [&](int64_t at, int steps) {
    tracker.solve(main, nullptr, motion, at, scene.extent, {steps, little_blur * track.blur}, trust);
  };
  if (key == 1) solve(0, track.steps);
  if (key > 2) {
    const int64_t oldest = std::max<int64_t>(0, key - track.window);
    for (int k = 0; k < track.again; ++k) solve(oldest + state_.random.below(key - oldest), few_steps);
  }
  tracker.follow(main, motion, key, scene.extent, trust);
  state_.scene.main_motion = constant_after(key, motion).on(scene.device());
}

void BodyTraining::split_bodies(int64_t key) {
  constexpr std::array<int64_t, 4> at = {5, 10, 20, 40};
  if (!solves() || std::find(at.begin(), at.end(), key) == at.end()) return;
  Scene& scene = state_.scene;
  Surfels main = scene.main.on(Device::cpu);
  Motion motion = scene.main_motion->on(Device::cpu);
  const int64_t added = tracker().part_bodies(main, state_.initial_main_count, motion, key, scene.extent);
  if (added == 0) return;
  scene.main.body = main.body.on(scene.device());
  scene.main_motion = motion.on(scene.device());
  state_.optimiser.begin(*scene.main_motion);
  // The statistics are of the bodies before.
  state_.bodies.texture_trust = {};
  stream_.emit(events::BodiesParted{state_.iteration, added, motion.bodies()});
}

Surfels BodyTraining::new_surface(int64_t key, int64_t max_main) const {
  const InitialOptions& initial = options_.initial;
  const Scene& scene = state_.scene;
  const float tint = initial.tint_in_mask > 0 ? initial.tint_in_mask : initial.tint;
  Motion motion = scene.main_motion->on(Device::cpu);
  Surfels made = tracker().new_surface(scene.main.on(Device::cpu), motion, key, scene.extent, tint,
                                       max_main - scene.main.count());
  if (made.has_roughness()) made.roughness_logit.fill(roughness_logit(initial.roughness));
  return made;
}

void BodyTraining::solve_all_keys(bool refines) {
  if (!solves()) return;
  Scene& scene = state_.scene;
  Surfels main = scene.main.on(Device::cpu);
  Motion motion = scene.main_motion->on(Device::cpu);
  const TrackOptions& track = options_.deform.track;
  const Tracker tracker = this->tracker();
  std::optional<Nodes> nodes;
  if (scene.main_nodes) nodes = scene.main_nodes->on(Device::cpu);
  // A body that deforms may be larger at the first key than at others.
  if (!nodes) correct_sizes(tracker, refines, main, motion);
  const PoseSteps steps{few_steps, little_blur * track.blur, refines};
  for (int64_t key = 0; key < motion.keys(); ++key) {
    tracker.solve(main, nodes ? &*nodes : nullptr, motion, key, scene.extent, steps,
                  state_.bodies.texture_trust);
  }
  scene.main_motion = motion.on(scene.device());
  if (!scene.lighting) return;
  Lighting lighting = scene.lighting->on(Device::cpu);
  carry_lighting(motion, main, lighting);
  scene.lighting = lighting.on(scene.device());
}

void BodyTraining::correct_sizes(const Tracker& tracker, bool refines, Surfels& main, Motion& motion) {
  const std::optional<std::vector<Vec3<double>>> eyes = positions_of_single_cameras(capture_, motion);
  if (!eyes) return;
  Scene& scene = state_.scene;
  const TrackOptions& track = options_.deform.track;
  if (refines) {
    const std::vector<double> ratios = tracker.distance_ratios(
        main, motion, scene.extent, {track.steps, little_blur * track.blur}, state_.bodies.texture_trust);
    rescale_bodies(ratios, *eyes, 1, main, motion);
  }
  std::vector<double> ratios = tracker.distances_by_points(main, motion, scene.extent);
  for (double& ratio : ratios) ratio = 1 / ratio;
  rescale_bodies(ratios_of_what_moves(ratios, *eyes, motion), *eyes, 0, main, motion);
  scene.main.position = main.position.on(scene.device());
  scene.main.log_scale = main.log_scale.on(scene.device());
}

void BodyTraining::correct_priors() {
  std::optional<Mat3<double>>& bias = state_.bodies.prior_bias;
  // Only once: the depth follows the priors, so a second measurement would find what the first one changed.
  if (!options_.deform.track.prior_turn || bias) return;
  bias = measured_prior_bias(capture_, state_.scene, renderer_);
  if (!bias) return;
  state_.apply_to(capture_.train);
  constexpr double degrees = 57.29577951308232;
  const double cosine = ((*bias)[0][0] + (*bias)[1][1] + (*bias)[2][2] - 1) / 2;
  stream_.emit(events::PriorsTurned{state_.iteration, degrees * std::acos(std::clamp(cosine, -1.0, 1.0))});
}

void BodyTraining::release_outliers(int64_t key) {
  Surfels main = state_.scene.main.on(Device::cpu);
  const Motion motion = state_.scene.main_motion->on(Device::cpu);
  release_strays(capture_, motion, motion.time[key], main);
  set_bodies(main.body);
}

void BodyTraining::release_all() {
  Tensor<int32_t> none(state_.scene.main.body.shape());
  none.fill(moved_by_field);
  set_bodies(none);
  state_.bodies.released = true;
}

void BodyTraining::set_bodies(const Tensor<int32_t>& body) {
  // A released point of the capture is static at its place and starts like surfels that never belonged to a
  // body. New surface becomes transparent, because nothing showed it to be static.
  constexpr float unseen = -8;
  Surfels& scene = state_.scene.main;
  Surfels main = scene.on(Device::cpu);
  Tensor<float> points({std::min(state_.initial_main_count, main.count()), 3});
  std::copy_n(main.position.data(), points.size(), points.data());
  const Tensor<float> log_scale = log_spacing(points);
  for (int64_t i = 0; i < main.count(); ++i) {
    if (main.body[i] == body[i]) continue;
    const bool is_point = i < points.dim(0);
    main.opacity_logit[i] = is_point ? logit(options_.initial.opacity) : unseen;
    if (is_point) main.log_scale(i, 0) = main.log_scale(i, 1) = log_scale[i];
  }
  scene.log_scale = main.log_scale.on(scene.device());
  scene.opacity_logit = main.opacity_logit.on(scene.device());
  scene.body = body.on(scene.device());
}

void BodyTraining::finish_tracking() {
  Scene& scene = state_.scene;
  const std::vector<double> silhouettes = silhouette_errors(capture_, scene, renderer_);
  if (capture_.masks_are_found && mean_of(silhouettes) > most_silhouette_error) {
    const Motion at_rest = constant_after(0, scene.main_motion->on(Device::cpu)).on(scene.device());
    const double colours = relative_colour_error(
        capture_, at_rest, schedule_.sh_degree_main(state_.iteration), scene, renderer_);
    if (colours > most_colour_error) {
      const std::string text = fmt::format(
          "the bodies' silhouettes are off by {:.0f}% of the masks' area, and their colours by {:.0f}% of "
          "what they would be off by if they stood still: a field moves what moves",
          100 * mean_of(silhouettes), 100 * colours);
      stream_.emit(events::Warning{state_.iteration, text});
      release_all();
    }
  }
  freeze_background();
  if (state_.bodies.released) return;
  if (!state_.bodies.at_rest) enable_bending(silhouettes);
  if (options_.deform.lighting.cells > 0) enable_lighting();
}

void BodyTraining::freeze_background() {
  Surfels main = state_.scene.main.on(Device::cpu);
  const int sh_degree = schedule_.sh_degree_main(state_.iteration);
  mark_still(measured_unrest(capture_, state_.scene, sh_degree, renderer_), main);
  state_.scene.main.body = main.body.on(state_.scene.device());
}

void BodyTraining::enable_bending(const std::vector<double>& silhouette_errors) {
  const BendOptions& bend = options_.deform.bend;
  if (silhouette_errors.empty() || bend.nodes == 0) return;
  Scene& scene = state_.scene;
  const Surfels main = scene.main.on(Device::cpu);
  Motion motion = scene.main_motion->on(Device::cpu);
  Nodes nodes = place_nodes(motion, main, bend.nodes, bend.every);
  if (nodes.count() == 0) return;
  const double first = silhouette_errors.front();
  const double silhouettes = first > 0 ? mean_of(silhouette_errors) / first : 1;
  std::vector<int32_t> textured;
  for (int32_t body = 0; body < motion.bodies() && options_.deform.track.adjust > 0; ++body) {
    if (state_.bodies.texture_trust.holds_texture(body)) textured.push_back(body);
  }
  std::vector<Tracker::Adjusted> adjusted;
  if (!textured.empty()) adjusted = tracker().adjust(main, textured, motion, nodes, scene.extent);
  std::vector<bool> bends(static_cast<size_t>(motion.bodies()), silhouettes > bend.misfit);
  std::vector<std::optional<double>> photographs(bends.size());
  for (const Tracker::Adjusted& body : adjusted) {
    const auto b = static_cast<size_t>(body.body);
    bends[b] = bends[b] || body.as_bent < bend.better * body.as_rigid;
    if (bends[b]) take_body(body.body, body.motion, body.nodes, motion, nodes);
    anchor_nodes(motion, body.body, nodes);
    if (body.as_rigid > 0) photographs[b] = body.as_bent / body.as_rigid;
  }
  for (size_t b = 0; b < bends.size(); ++b) {
    stream_.emit(events::BendingDecided{state_.iteration, static_cast<int64_t>(b), bends[b], silhouettes,
                                        photographs[b]});
  }
  nodes = nodes_of(nodes, bends);
  if (nodes.count() == 0) return;
  scene.main_motion = motion.on(scene.device());
  scene.main_nodes = nodes.on(scene.device());
  state_.optimiser.begin(*scene.main_nodes);
}

void BodyTraining::enable_lighting() {
  Scene& scene = state_.scene;
  const LightingOptions& light = options_.deform.lighting;
  scene.lighting = lighting_around(scene.main_motion->on(Device::cpu), scene.main.on(Device::cpu),
                                   light.cells, light.every, light.bodies)
                       .on(scene.device());
  state_.optimiser.begin(*scene.lighting);
}

}  // namespace traceflow

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "math/activation.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "track/bodies.h"
#include "track/prior_bias.h"
#include "track/rescale.h"
#include "train/initialise.h"
#include "train/trainer.h"

// The part of the loop that tracks bodies from key to key before everything trains.
namespace traceflow {

namespace {

// For keys that were solved before: fewer steps and less blur.
constexpr int few_steps = 3;
constexpr double little_blur = 0.35;

// Bodies are dropped if they exceed both: the silhouette error relative to the area of found masks, and the
// colour error relative to that of bodies at rest.
constexpr double most_misfit = 1.0 / 3, most_colour_error = 0.8;

double mean_of(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Spread evenly over the video, in the order of time.
std::vector<const View*> some_views(const Capture& capture) {
  constexpr size_t most_views = 20;
  std::vector<const View*> all;
  for (const View& view : capture.train) all.push_back(&view);
  std::stable_sort(all.begin(), all.end(), [](const View* a, const View* b) { return a->time < b->time; });
  const size_t step = (all.size() + most_views - 1) / most_views;
  std::vector<const View*> some;
  for (size_t k = 0; k < all.size(); k += step) some.push_back(all[k]);
  return some;
}

// Renders the bodies at the view's time, without field and reflections.
FrameRequest request_without_field(const View& view) {
  FrameRequest request;
  request.camera = view.camera;
  request.time = view.time;
  request.deform_main = request.specular = false;
  return request;
}

Motion standing_from(int64_t key, Motion motion) {
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    for (int64_t later = key + 1; later < motion.keys(); ++later) {
      std::copy_n(&motion.rotation(b, key, 0), 4, &motion.rotation(b, later, 0));
      std::copy_n(&motion.shift(b, key, 0), 3, &motion.shift(b, later, 0));
    }
  }
  return motion;
}

}  // namespace

Trainer::Tracking Trainer::tracking(int iteration) const {
  if (!scene_.main_motion) return {};
  const TrackOptions& track = options_.deform.track;
  constexpr int least_share = 8;  // of a run: limits the warm-up
  const int64_t keys = scene_.main_motion->keys();
  const int since = iteration - std::min(track.warm_up, options_.iterations / least_share);
  if (since < 0) return {.goes_on = true};
  if (skips_following()) {
    return {.refines = schedule_.solves_poses_again(iteration, iteration - since), .key = keys - 1};
  }
  const int64_t key = 1 + since / track.map_each;
  if (key < keys) return {.goes_on = true, .enters = since % track.map_each == 0, .key = key};
  Tracking now{.enters = key == keys && since % track.map_each == 0, .key = keys - 1};
  const int64_t followed = iteration - since + (keys - 1) * track.map_each;
  now.refines = !now.enters && schedule_.solves_poses_again(iteration, followed);
  return now;
}

Tracker Trainer::make_tracker() const {
  return {options_.deform.track, schedule_.render(iteration_), capture_};
}

Surfels Trainer::follow_bodies(const Tracking& now) {
  constexpr int64_t strays_every = 5;  // keys
  Surfels made;
  if (now.enters && now.key == 1) see_whether_bodies_stand();
  if (now.enters && now.key == 1 && skips_following()) {
    divergence_.expect_fall();
    let_strays_go(scene_.main_motion->keys() - 1);
    settle();
    return made;
  }
  const bool has_come_to_the_end = now.enters && !now.goes_on;
  if (now.enters && now.goes_on) {
    follow(now.key);
    part_bodies(now.key);
    if (options_.deform.track.new_surface) made = new_surface(now.key);
  }
  if ((now.refines && carries_) || has_come_to_the_end) follow_again();
  if (now.refines && carries_) turn_priors();
  if (now.enters && (now.key % strays_every == 0 || has_come_to_the_end)) let_strays_go(now.key);
  if (has_come_to_the_end) settle();
  return made;
}

void Trainer::settle() {
  const std::vector<double> misfits = silhouette_misfits();
  if (capture_.masks_are_found && mean_of(misfits) > most_misfit) {
    const double colours = colour_error_over_standing();
    if (colours > most_colour_error) {
      warn(fmt::format(
          "the bodies' silhouettes are off by {:.0f}% of the masks' area, and their colours by {:.0f}% of "
          "what they would be off by if they stood still: a field moves what moves",
          100 * mean_of(misfits), 100 * colours));
      let_everything_go();
    }
  }
  let_stand();
  if (!carries_) return;
  if (!bodies_stand_) let_bend(misfits);
  if (options_.deform.lighting.cells > 0) let_light_change();
}

void Trainer::keep_sizes(const Tracker& tracker, bool poses_are_known, Surfels& main, Motion& motion) {
  const std::optional<std::vector<Vec3<double>>> eyes = positions_of_single_cameras(capture_, motion);
  if (!eyes) return;
  const TrackOptions& track = options_.deform.track;
  if (poses_are_known) {
    const std::vector<double> ratios = tracker.distance_ratios(
        main, motion, scene_.extent, {track.steps, little_blur * track.blur}, texture_trust_);
    rescale_bodies(ratios, *eyes, 1, main, motion);
  }
  std::vector<double> ratios = tracker.distances_by_points(main, motion, scene_.extent);
  for (double& ratio : ratios) ratio = 1 / ratio;
  rescale_bodies(ratios_of_what_moves(ratios, *eyes, motion), *eyes, 0, main, motion);
  scene_.main.position = main.position.on(device_);
  scene_.main.log_scale = main.log_scale.on(device_);
}

void Trainer::follow_again() {
  if (options_.deform.track.true_poses || bodies_stand_) return;
  Surfels main = scene_.main.on(Device::cpu);
  Motion motion = scene_.main_motion->on(Device::cpu);
  const TrackOptions& track = options_.deform.track;
  const Tracker tracker = make_tracker();
  std::optional<Nodes> nodes;
  if (scene_.main_nodes) nodes = scene_.main_nodes->on(Device::cpu);
  const bool refines = tracking(iteration_).refines;
  // A body that deforms may be larger at the first key than at others.
  if (!nodes) keep_sizes(tracker, refines, main, motion);
  const PoseSteps steps{few_steps, little_blur * track.blur, refines};
  for (int64_t key = 0; key < motion.keys(); ++key)
    tracker.solve(main, nodes ? &*nodes : nullptr, motion, key, scene_.extent, steps, texture_trust_);
  scene_.main_motion = motion.on(device_);
  if (!scene_.lighting) return;
  Lighting lighting = scene_.lighting->on(Device::cpu);
  carry_lighting(motion, main, lighting);
  scene_.lighting = lighting.on(device_);
}

void Trainer::see_whether_bodies_stand() {
  if (options_.deform.track.true_poses) return;
  const std::vector<double> misfits = silhouette_misfits();
  if (misfits.empty()) return;
  const double misfit = mean_of(misfits);
  bodies_stand_ = misfit < options_.deform.track.still;
  stream_.emit(events::FollowingDecided{iteration_, !bodies_stand_, misfit});
}

bool Trainer::skips_following() const { return bodies_stand_ && capture_.has_normal_priors; }

void Trainer::follow(int64_t key) {
  divergence_.expect_fall();
  if (options_.deform.track.true_poses || bodies_stand_) return;
  const Surfels main = scene_.main.on(Device::cpu);
  Motion motion = scene_.main_motion->on(Device::cpu);
  const TrackOptions& track = options_.deform.track;
  const Tracker tracker = make_tracker();
  if (key == 1)
    tracker.solve(main, nullptr, motion, 0, scene_.extent, {track.steps, little_blur * track.blur},
                  texture_trust_);
  if (key > 2) {
    const int64_t oldest = std::max<int64_t>(0, key - track.window);
    for (int k = 0; k < track.again; ++k) {
      const int64_t at = oldest + static_cast<int64_t>(random_.below(static_cast<int64_t>(key - oldest)));
      tracker.solve(main, nullptr, motion, at, scene_.extent, {few_steps, little_blur * track.blur},
                    texture_trust_);
    }
  }
  tracker.follow(main, motion, key, scene_.extent, texture_trust_);
  // Later keys keep the pose of this key until they are tracked.
  scene_.main_motion = standing_from(key, motion).on(device_);
}

void Trainer::part_bodies(int64_t key) {
  constexpr std::array<int64_t, 4> at = {5, 10, 20, 40};
  if (options_.deform.track.true_poses || bodies_stand_ || std::find(at.begin(), at.end(), key) == at.end())
    return;
  Surfels main = scene_.main.on(Device::cpu);
  Motion motion = scene_.main_motion->on(Device::cpu);
  const Tracker tracker = make_tracker();
  const int64_t added = tracker.part_bodies(main, initial_main_count_, motion, key, scene_.extent);
  if (added == 0) return;
  scene_.main.body = main.body.on(device_);
  scene_.main_motion = motion.on(device_);
  optimiser_.begin(*scene_.main_motion);
  // The statistics are of the bodies before.
  texture_trust_ = {};
  stream_.emit(events::BodiesParted{iteration_, added, motion.bodies()});
}

Surfels Trainer::new_surface(int64_t key) const {
  const InitialOptions& initial = options_.initial;
  const float tint = initial.tint_in_mask > 0 ? initial.tint_in_mask : initial.tint;
  Motion motion = scene_.main_motion->on(Device::cpu);
  Surfels made = make_tracker().new_surface(scene_.main.on(Device::cpu), motion, key, scene_.extent, tint,
                                            memory_.caps.main - scene_.main.count());
  if (made.has_roughness()) made.roughness_logit.fill(roughness_logit(initial.roughness));
  return made;
}

void Trainer::let_strays_go(int64_t key) {
  Surfels main = scene_.main.on(Device::cpu);
  const Motion motion = scene_.main_motion->on(Device::cpu);
  const Tensor<int32_t> carried = main.body;
  release_strays(capture_, motion, motion.time[key], main);
  begin_anew(carried, std::move(main));
}

void Trainer::let_everything_go() {
  Surfels main = scene_.main.on(Device::cpu);
  const Tensor<int32_t> carried = main.body;
  main.body.fill(moved_by_field);
  begin_anew(carried, std::move(main));
  carries_ = false;
}

void Trainer::begin_anew(const Tensor<int32_t>& carried, Surfels main) {
  // A released point of the capture is static at its place and starts like surfels that never belonged to a
  // body. New surface becomes transparent, because nothing showed it to be static.
  constexpr float unseen = -8;
  Tensor<float> points({std::min(initial_main_count_, main.count()), 3});
  std::copy_n(main.position.data(), points.size(), points.data());
  const Tensor<float> log_scale = log_spacing(points);
  for (int64_t i = 0; i < main.count(); ++i) {
    if (main.body[i] == carried[i]) continue;
    const bool is_point = i < points.dim(0);
    main.opacity_logit[i] = is_point ? logit(options_.initial.opacity) : unseen;
    if (is_point) main.log_scale(i, 0) = main.log_scale(i, 1) = log_scale[i];
  }
  scene_.main.log_scale = main.log_scale.on(device_);
  scene_.main.opacity_logit = main.opacity_logit.on(device_);
  scene_.main.body = main.body.on(device_);
}

std::optional<double> Trainer::silhouette_misfit(const View& view) {
  const std::shared_ptr<const ViewImages> images = load_images(capture_, view);
  if (images->coverage.empty()) return std::nullopt;
  FrameRequest request = request_without_field(view);
  request.silhouette = true;
  const Tensor<float> silhouette =
      renderer_.forward(scene_, request, false).raster.silhouette.on(Device::cpu);
  double off = 0, area = 0;
  for (int64_t i = 0; i < images->coverage.size(); ++i) {
    off += std::abs(silhouette[i] - images->coverage[i]);
    area += images->coverage[i];
  }
  return area > 0 ? off / area : 0;
}

void Trainer::share_among_keys() {
  // Pose errors extend over many keys, but a view has a gradient only for its own key.
  constexpr float widest = 4;  // keys
  constexpr float share_of_film = 0.05F;
  Motion& gradient = gradient_.main_motion;
  const float width = std::min(widest, share_of_film * static_cast<float>(gradient.keys()));
  motion::spread_over_keys(*scene_.main_motion, width, gradient);
  motion::hold_first_key(gradient);
}

void Trainer::hold_nodes() {
  const BendOptions& bend = options_.deform.bend;
  nodes::resist(*scene_.main_nodes, *scene_.main_motion, {bend.strain, bend.haste, bend.travel},
                gradient_.main_nodes);
  nodes::hold_first(gradient_.main_nodes);
}

std::vector<double> Trainer::silhouette_misfits() {
  std::vector<double> misfits;
  for (const View* view : some_views(capture_)) {
    if (const std::optional<double> misfit = silhouette_misfit(*view)) misfits.push_back(*misfit);
  }
  return misfits;
}

double Trainer::colour_error_over_standing() {
  struct Drawn {
    Tensor<float> colour, silhouette;
  };
  const auto draw = [&](const View& view) {
    FrameRequest request = request_without_field(view);
    request.sh_degree_main = schedule_.sh_degree_main(iteration_);
    request.silhouette = true;
    const Frame& frame = renderer_.forward(scene_, request, false);
    return Drawn{frame.colour.on(Device::cpu), frame.raster.silhouette.on(Device::cpu)};
  };
  const std::vector<const View*> views = some_views(capture_);
  std::vector<Drawn> followed, standing;
  for (const View* view : views) followed.push_back(draw(*view));
  const Motion motion = scene_.main_motion->on(Device::cpu);
  scene_.main_motion = standing_from(0, motion).on(device_);
  for (const View* view : views) standing.push_back(draw(*view));
  scene_.main_motion = motion.on(device_);
  double off = 0, off_standing = 0;
  for (size_t k = 0; k < views.size(); ++k) {
    const std::shared_ptr<const ViewImages> images = load_images(capture_, *views[k]);
    for (int64_t i = 0; i < followed[k].silhouette.size(); ++i) {
      if (!images->known.empty() && images->known[i] == 0) continue;
      const double share = std::max(followed[k].silhouette[i], standing[k].silhouette[i]);
      for (int64_t c = 3 * i; c < 3 * i + 3; ++c) {
        off += share * std::abs(followed[k].colour[c] - images->colour[c]);
        off_standing += share * std::abs(standing[k].colour[c] - images->colour[c]);
      }
    }
  }
  return off_standing > 0 ? off / off_standing : 1;
}

void Trainer::turn_priors() {
  // Only once: the depth follows the priors, so a second measurement would find what the first one changed.
  if (!options_.deform.track.prior_turn || prior_bias_) return;
  constexpr float opaque = 0.95F;
  PriorBias in_masks;
  for (const View* view : some_views(capture_)) {
    const std::shared_ptr<const ViewImages> images = load_images(capture_, *view);
    if (images->mask.empty() || images->normal_prior.empty()) continue;
    FrameRequest request = request_without_field(*view);
    request.pseudo_normals = true;
    const Frame& frame = renderer_.forward(scene_, request, false);
    const Tensor<float> alpha = frame.raster.alpha.on(Device::cpu),
                        normal = frame.pseudo_normal.on(Device::cpu);
    for (int64_t i = 0; i < alpha.size(); ++i) {
      if (images->mask[i] == 0 || alpha[i] < opaque) continue;
      in_masks.add(view->camera, load3<double>(&normal[3 * i]), load3<double>(&images->normal_prior[3 * i]));
    }
  }
  const std::optional<Mat3<double>> bias = in_masks.rotation();
  if (!bias) return;
  set_prior_bias(*bias);
  constexpr double degrees = 57.29577951308232;
  const double angle =
      std::acos(std::clamp(((*bias)[0][0] + (*bias)[1][1] + (*bias)[2][2] - 1) / 2, -1.0, 1.0));
  stream_.emit(events::PriorsTurned{iteration_, degrees * angle});
}

void Trainer::set_prior_bias(const Mat3<double>& bias) {
  prior_bias_ = bias;
  for (View& view : capture_.train) view.prior_turn = inverse_of_bias(view.camera, bias);
}

void Trainer::let_bend(const std::vector<double>& misfits) {
  const BendOptions& bend = options_.deform.bend;
  const TrackOptions& track = options_.deform.track;
  if (misfits.empty() || bend.nodes == 0) return;
  const Surfels main = scene_.main.on(Device::cpu);
  Motion motion = scene_.main_motion->on(Device::cpu);
  Nodes nodes = place_nodes(motion, main, bend.nodes, bend.every);
  if (nodes.count() == 0) return;
  const double silhouettes = misfits.front() > 0 ? mean_of(misfits) / misfits.front() : 1;
  std::vector<int32_t> textured;
  for (int32_t body = 0; body < motion.bodies() && track.adjust > 0; ++body) {
    if (texture_trust_.holds_texture(body)) textured.push_back(body);
  }
  std::vector<Tracker::Adjusted> adjusted;
  if (!textured.empty()) {
    adjusted = make_tracker().adjust(main, textured, motion, nodes, scene_.extent);
  }
  std::vector<bool> bends(static_cast<size_t>(motion.bodies()), silhouettes > bend.misfit);
  for (const Tracker::Adjusted& body : adjusted) {
    const auto b = static_cast<size_t>(body.body);
    bends[b] = bends[b] || body.as_bent < bend.better * body.as_rigid;
    if (bends[b]) take_body(body.body, body.motion, body.nodes, motion, nodes);
    anchor_nodes(motion, body.body, nodes);
  }
  for (size_t b = 0; b < bends.size(); ++b) {
    events::BendingDecided decided{iteration_, static_cast<int64_t>(b), bends[b], silhouettes, std::nullopt};
    for (const Tracker::Adjusted& body : adjusted) {
      if (static_cast<size_t>(body.body) == b && body.as_rigid > 0)
        decided.photographs = body.as_bent / body.as_rigid;
    }
    stream_.emit(decided);
  }
  nodes = nodes_of(nodes, bends);
  if (nodes.count() == 0) return;
  scene_.main_motion = motion.on(device_);
  scene_.main_nodes = nodes.on(device_);
  optimiser_.begin(*scene_.main_nodes);
}

void Trainer::let_light_change() {
  const LightingOptions& light = options_.deform.lighting;
  scene_.lighting = lighting_around(scene_.main_motion->on(Device::cpu), scene_.main.on(Device::cpu),
                                    light.cells, light.every, light.bodies)
                        .on(device_);
  optimiser_.begin(*scene_.lighting);
}

void Trainer::let_stand() {
  constexpr size_t most_views = 40;
  Surfels main = scene_.main.on(Device::cpu);
  Unrest unrest;
  const size_t step = std::max<size_t>(1, capture_.train.size() / most_views);
  for (size_t k = 0; k < capture_.train.size(); k += step) {
    const View& view = capture_.train[k];
    const std::shared_ptr<const ViewImages> images = load_images(capture_, view);
    if (images->mask.empty()) continue;
    FrameRequest request = request_without_field(view);
    request.sh_degree_main = schedule_.sh_degree_main(iteration_);
    const Frame& frame = renderer_.forward(scene_, request, false);
    unrest.look(main, view, *images, frame.colour.on(Device::cpu), frame.raster.alpha.on(Device::cpu),
                frame.raster.depth.on(Device::cpu));
  }
  mark_still(unrest, main);
  scene_.main.body = main.body.on(device_);
}

const View& Trainer::draw_tracked_view(const Tracking& now) {
  // Many views are of the first key, whose points determine the size of a body, and of the newest keys, whose
  // surface is the least known.
  constexpr double first_share = 0.3, newest_share = 0.35;
  constexpr float newest_duration = 0.08F;
  const Tensor<float> times = scene_.main_motion->time.on(Device::cpu);
  const float latest = times[now.key];
  const auto draw_between = [&](float from, float to) -> const View& {
    std::vector<const View*> views;
    for (const View& view : capture_.train) {
      if (view.time >= from && view.time <= to) views.push_back(&view);
    }
    return *views[random_.below(static_cast<int64_t>(views.size()))];
  };
  const double share = now.key > 0 ? random_.uniform() : 1;
  if (share < first_share) return draw_between(times[0], times[0]);
  if (share < first_share + newest_share) return draw_between(latest - newest_duration, latest);
  for (;;) {
    const View& view = capture_.train[static_cast<size_t>(views_.draw(random_))];
    if (view.time <= latest) return view;
  }
}

}  // namespace traceflow

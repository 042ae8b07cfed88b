#include "track/tracker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "math/rotation_group.h"
#include "scene/rows.h"
#include "track/body_centre.h"
#include "track/body_parts.h"
#include "track/mirror_image.h"
#include "track/point_distance.h"
#include "track/redetection.h"
#include "track/rescale.h"
#include "track/turn_search.h"

namespace traceflow {

namespace {

// Sizes of small bodies need images of the size used in training.
constexpr int widest_for_sizes = 320;
constexpr int keys_for_speed = 3;
// The number of keys back for the rotation that colour may undo.
constexpr int64_t keys_for_trust = 5;
// Radians. The solver's steps are short, so texture cannot undo more of a rotation. Larger rotations, for
// example over a gap in the video, are no evidence beyond it.
constexpr double most_judged = 0.3;

// The largest width of compared photographs, and how many keys back the oldest one is.
constexpr int64_t widest_photograph = 640, oldest_photograph = 9;

template <class Views>
auto oldest_of(const Views& earlier) {
  return std::find_if(earlier.begin(), earlier.end(),
                      [](const auto& view) { return view.keys_back == oldest_photograph; });
}

// The mean of factor × factor pixels.
Tensor<float> smaller(const Tensor<float>& image, int64_t numbers, int64_t factor) {
  const int64_t height = image.dim(0) / factor, width = image.dim(1) / factor;
  Tensor<float> result(numbers == 1 ? Shape{height, width} : Shape{height, width, numbers});
  const float share = 1.0F / static_cast<float>(factor * factor);
  for (int64_t y = 0; y < height * factor; ++y) {
    for (int64_t x = 0; x < width * factor; ++x) {
      const float* const from = image.data() + (y * image.dim(1) + x) * numbers;
      float* const to = result.data() + (y / factor * width + x / factor) * numbers;
      for (int64_t k = 0; k < numbers; ++k) to[k] += share * from[k];
    }
  }
  return result;
}

bool any_turns(const LooseTurns& loose) {
  return std::any_of(loose.begin(), loose.end(),
                     [](const Mat3<double>& turns) { return turns != Mat3<double>(0); });
}

int shrink_factor(const Camera<float>& camera, int widest) { return (camera.width + widest - 1) / widest; }

// The rotation of a body between two keys, radians about world axes.
Vec3<double> turn_between(const Motion& motion, int64_t body, int64_t first, int64_t last) {
  const Vec4<double> from = unit_quaternion(load4<double>(&motion.rotation(body, first, 0)));
  const Vec4<double> to = unit_quaternion(load4<double>(&motion.rotation(body, last, 0)));
  return quaternion_log(quaternion_product(to, quaternion_conjugate(from)));
}

// Makes bodies with loose rotations rotate about the given points (world coordinates at the key, one per
// body). A rotation of a ball about another point would move it.
void centre_loose_bodies(const std::vector<Vec3<double>>& centres, const LooseTurns& loose, int64_t key,
                         Motion& motion) {
  for (size_t b = 0; b < loose.size(); ++b) {
    if (loose[b] == Mat3<double>(0)) continue;
    const auto body = static_cast<int32_t>(b);
    const SurfacePoint rest = at_rest({body, Vec3<float>(centres[b]), Vec3<float>(0)}, motion, key);
    move_centre(body, Vec3<double>(rest.position), motion);
  }
}

// Stops the loose rotations of bodies that mirror, because nothing determines them.
void hold_mirrors(Motion& motion, int64_t key, const LooseTurns& loose, const TextureTrust& trust) {
  for (int64_t b = 0; b < motion.bodies() && !loose.empty(); ++b) {
    if (!trust.mirrors(b)) continue;
    const Vec3<double> turn = turn_between(motion, b, key - 1, key);
    const Vec4<double> before = unit_quaternion(load4<double>(&motion.rotation(b, key - 1, 0)));
    const Vec4<double> held =
        quaternion_product(quaternion_exp(turn - loose[static_cast<size_t>(b)] * turn), before);
    for (int c = 0; c < 4; ++c) motion.rotation(b, key, c) = static_cast<float>(held[c]);
  }
}

}  // namespace

raster::Options raster_for_tracking(const RenderOptions& render, float extent) {
  raster::Options options = render.raster_options(extent);
  options.low_pass /= static_cast<float>(render.samples);
  return options;
}

Tracker::Tracker(const TrackOptions& options, const RenderOptions& render, const Capture& capture)
    : options_(options), render_(render), capture_(capture) {}

void Tracker::predict(Motion& motion, int64_t key) {
  if (key == 0) return;
  const int64_t last = key - 1, first = std::max<int64_t>(0, last - keys_for_speed);
  const double span = static_cast<double>(motion.time[last]) - motion.time[first];
  const double share = span > 0 ? (motion.time[key] - static_cast<double>(motion.time[last])) / span : 0;
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const Vec4<double> to = unit_quaternion(load4<double>(&motion.rotation(b, last, 0)));
    const Vec4<double> rotation =
        quaternion_product(quaternion_exp(share * turn_between(motion, b, first, last)), to);
    const Vec3<double> a = load3<double>(&motion.shift(b, first, 0)),
                       z = load3<double>(&motion.shift(b, last, 0));
    for (int64_t k = key; k < motion.keys(); ++k) {
      for (int c = 0; c < 4; ++c) motion.rotation(b, k, c) = static_cast<float>(rotation[c]);
      store3(&motion.shift(b, k, 0), z + share * (z - a));
    }
  }
}

Camera<float> Tracker::drawn_camera(const View& view, int widest) {
  Camera<float> camera = view.camera;
  const int factor = shrink_factor(camera, widest);
  camera.width /= factor;
  camera.height /= factor;
  for (float* length : {&camera.focal_x, &camera.focal_y, &camera.centre_x, &camera.centre_y})
    *length /= static_cast<float>(factor);
  return camera;
}

TrackTarget Tracker::target_of(const View& view, int widest) const {
  const std::shared_ptr<const ViewImages> images = load_images(capture_, view);
  const int64_t factor = shrink_factor(view.camera, widest);
  TrackTarget target;
  target.camera = view.camera;
  if (images->coverage.empty()) return target;
  target.is_shrunk = factor > 1;
  target.camera = drawn_camera(view, widest);
  target.coverage = smaller(images->coverage, 1, factor);
  target.colour = smaller(images->colour, 3, factor);
  target.mask.resize(target.coverage.shape());
  for (int64_t i = 0; i < target.mask.size(); ++i) target.mask[i] = target.coverage[i] >= 0.5F ? 1 : 0;
  if (images->normal_prior.empty()) return target;
  target.prior_is_unbiased = view.prior_turn.has_value();
  target.normal_prior = smaller(images->normal_prior, 3, factor);
  for (int64_t i = 0; i < target.normal_prior.size(); i += 3) {
    const Vec3<float> n = load3<float>(&target.normal_prior[i]);
    const float length = glm::length(n);
    store3(&target.normal_prior[i], length > 0.5F ? n / length : Vec3<float>(0));
  }
  return target;
}

PoseSolver Tracker::solver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
                           int widest) const {
  std::vector<TrackTarget> targets;
  for (const View& view : capture_.train) {
    if (view.time != motion.time[key]) continue;
    TrackTarget target = target_of(view, widest);
    if (!target.coverage.empty()) targets.push_back(std::move(target));
  }
  PoseSolver solver(main, nodes, motion, key, raster_for_tracking(render_, extent), std::move(targets));
  solver.turn_priors();
  return solver;
}

std::vector<size_t> Tracker::views_at(const Motion& motion, int64_t key) const {
  std::vector<size_t> views;
  for (size_t i = 0; i < capture_.train.size(); ++i) {
    if (capture_.train[i].time == motion.time[key]) views.push_back(i);
  }
  return views;
}

std::vector<Tracker::EarlierView> Tracker::earlier_views(const Surfels& main, const Motion& motion,
                                                         int64_t key, float extent) const {
  // Near keys give the most precise motion, far ones keep errors from accumulating.
  constexpr std::array<int64_t, 4> keys_back = {1, 3, 9, 27};
  std::vector<EarlierView> earlier;
  for (const int64_t back : keys_back) {
    if (back > key || (back > oldest_photograph && !has_tracks())) break;
    for (const size_t view : views_at(motion, key - back)) {
      earlier.push_back({back, view,
                         draw_bodies(drawn_camera(capture_.train[view]), motion, key - back, main,
                                     raster_for_tracking(render_, extent))});
      if (!has_tracks()) break;
    }
  }
  return earlier;
}

void Tracker::compare_photographs(PoseSolver& solver, const std::vector<EarlierView>& earlier,
                                  const Motion& motion, int64_t key, const LooseTurns& loose) const {
  // The weight grows with the distance: over a few keys the reflection in a glossy coat, which hardly moves,
  // holds the texture back.
  constexpr double weight = 1.0 / oldest_photograph;
  if (!any_turns(loose)) return;
  std::shared_ptr<const DetailPhoto> now;
  int64_t last = 0;
  for (const auto& [back, at, surface] : earlier) {
    if (back == last || back > oldest_photograph) continue;
    last = back;
    FinePhotograph photograph = load_fine_photograph(capture_, capture_.train[at], widest_photograph);
    if (photograph.coverage.empty()) continue;
    if (!now) {
      FinePhotograph newest =
          load_fine_photograph(capture_, capture_.train[views_at(motion, key).front()], widest_photograph);
      if (newest.coverage.empty()) return;
      now = std::make_shared<const DetailPhoto>(detail_of(std::move(newest)));
    }
    // Scales the weight so that a rendered pixel counts as in the other residuals.
    const double finer = static_cast<double>(now->camera.focal_x) / surface.camera.focal_x;
    solver.compare(
        Alignment{now, detail_samples(detail_of(std::move(photograph)), surface, motion, key - back, loose),
                  weight * static_cast<double>(back) / (finer * finer)});
  }
}

bool Tracker::seek_turns(const std::vector<EarlierView>& earlier, Motion& motion, int64_t key,
                         const LooseTurns& loose) const {
  const auto from = oldest_of(earlier);
  if (from == earlier.end() || !any_turns(loose)) return false;
  FinePhotograph then = load_fine_photograph(capture_, capture_.train[from->view], widest_photograph);
  FinePhotograph now =
      load_fine_photograph(capture_, capture_.train[views_at(motion, key).front()], widest_photograph);
  if (then.coverage.empty() || now.coverage.empty()) return false;
  const auto photo = std::make_shared<const DetailPhoto>(detail_of(std::move(now)));
  const DetailPhoto before = detail_of(std::move(then));
  bool any = false;
  for (int32_t body = 0; body < motion.bodies(); ++body) {
    LooseTurns alone(loose.size(), Mat3<double>(0));
    alone[static_cast<size_t>(body)] = loose[static_cast<size_t>(body)];
    if (!any_turns(alone)) continue;
    const Alignment alignment{photo,
                              detail_samples(before, from->surface, motion, key - oldest_photograph, alone)};
    const std::optional<Vec3<double>> turn = seek_turn(alignment, motion, body, key, alone);
    if (!turn) continue;
    spread_turn(body, key - oldest_photograph, key, *turn, motion);
    any = true;
  }
  return any;
}

void Tracker::look_for_mirror_images(const std::vector<EarlierView>& earlier, const Motion& motion,
                                     int64_t key, const LooseTurns& loose, TextureTrust& trust) const {
  const auto from = oldest_of(earlier);
  if (from == earlier.end()) return;
  const Vec3<double> eye(capture_.train[views_at(motion, key).front()].camera.position);
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const Mat3<double>& turns = loose[static_cast<size_t>(b)];
    if (turns == Mat3<double>(0)) continue;
    const Vec3<double> shift =
        load3<double>(&motion.shift(b, key, 0)) - load3<double>(&motion.shift(b, key - oldest_photograph, 0));
    trust.add_turn(b, turns * turn_of_mirror_image(from->surface, static_cast<int32_t>(b), eye, shift),
                   turns * turn_between(motion, b, key - oldest_photograph, key));
  }
}

void Tracker::compare_tracks(PoseSolver& solver, const std::vector<EarlierView>& earlier,
                             const Motion& motion, int64_t key) const {
  if (!has_tracks()) return;
  for (const size_t view : views_at(motion, key)) {
    const Camera<float> camera = drawn_camera(capture_.train[view]);
    for (const auto& [back, at, surface] : earlier) {
      std::vector<TrackedPoint> points =
          tracked_points(capture_.tracks, static_cast<int64_t>(at), static_cast<int64_t>(view), surface,
                         motion, key - back, camera);
      solver.compare(Reprojection{camera, std::move(points), options_.tracks});
    }
  }
}

TrackWeights Tracker::weights(const Motion& motion, const TextureTrust& trust,
                              const LooseTurns& loose) const {
  TrackWeights weights{options_.silhouette, options_.normal, {}, {}};
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const bool is_ball = !loose.empty() && loose[static_cast<size_t>(b)] == Mat3<double>(1);
    weights.colour.push_back(trust.holds_colour(b) && !is_ball ? options_.colour : 0.0F);
    weights.tracks.push_back(has_tracks() && trust.holds_tracks(b) && !is_ball);
  }
  return weights;
}

LooseTurns Tracker::loosen(PoseSolver& solver, const Motion& motion, const TextureTrust& trust) const {
  LooseTurns loose;
  if (options_.colour > 0) loose = trust.loose_turns(solver.turn_stiffness(weights(motion, {}, {})));
  solver.loosen(loose, trust.without_mirrors(loose));
  return loose;
}

void Tracker::solve(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
                    const PoseSteps& steps, const TextureTrust& trust) const {
  PoseSteps held = steps;
  held.hold_depth = steps.hold_depth || key == 0;
  PoseSolver solver = this->solver(main, nodes, motion, key, extent);
  const LooseTurns loose = loosen(solver, motion, trust), by_texture = trust.without_mirrors(loose);
  // If bodies deform, the state at rest of a photograph's points is not known.
  if (nodes == nullptr && (any_turns(by_texture) || has_tracks())) {
    const std::vector<EarlierView> earlier = earlier_views(main, motion, key, extent);
    compare_photographs(solver, earlier, motion, key, by_texture);
    compare_tracks(solver, earlier, motion, key);
  }
  solver.solve(weights(motion, trust, loose), held);
}

std::vector<DetailPhoto> Tracker::film_normals(const Surfels& main, const Motion& motion,
                                               float extent) const {
  std::vector<DetailPhoto> normals(capture_.train.size());
  Motion stands = motion;
  for (int64_t key = 0; key < motion.keys(); ++key) {
    const PoseSolver at_key = solver(main, nullptr, stands, key, extent);
    size_t next = 0;
    for (const size_t view : views_at(motion, key)) {
      if (load_images(capture_, capture_.train[view])->coverage.empty()) continue;
      const TrackTarget& target = at_key.targets()[next++];
      if (target.normal_prior.empty()) continue;
      DetailPhoto prior{target.camera, target.normal_prior, target.mask};
      for (int64_t i = 0; i < prior.mask.size(); ++i) {
        const Vec3<float> n = load3<float>(&prior.detail[3 * i]);
        if (!(dot(n, n) > 0)) prior.mask[i] = 0;
      }
      normals[view] = cropped(prior);
    }
  }
  return normals;
}

FilmViews Tracker::film_views(const Motion& motion, int64_t widest, double blur,
                              const std::vector<DetailPhoto>& normals) const {
  std::vector<FilmView> views;
  for (int64_t key = 0; key < motion.keys(); ++key) {
    for (const size_t view : views_at(motion, key)) {
      FinePhotograph photograph = load_fine_photograph(capture_, capture_.train[view], widest);
      if (photograph.coverage.empty()) continue;
      views.push_back({key, drawn_camera(capture_.train[view]),
                       cropped(detail_of(std::move(photograph), blur)), normals[view]});
    }
  }
  return std::make_shared<const std::vector<FilmView>>(std::move(views));
}

std::vector<Tracker::Adjusted> Tracker::adjust(const Surfels& main, const std::vector<int32_t>& bodies,
                                               const Motion& motion, const Nodes& nodes, float extent) const {
  constexpr double blurs_across = 60;  // the coarsest blur is the image width over this
  std::vector<Adjusted> adjusted(bodies.size());
  std::vector<Motion> rigid(bodies.size(), motion);
  std::vector<PhotometricAdjustment> as_rigid, as_bent;
  const raster::Options drawing = raster_for_tracking(render_, extent);
  for (size_t b = 0; b < bodies.size(); ++b) {
    adjusted[b] = {bodies[b], 0, 0, motion, nodes};
    as_rigid.emplace_back(main, bodies[b], drawing, rigid[b], nullptr);
    as_bent.emplace_back(main, bodies[b], drawing, adjusted[b].motion, &adjusted[b].nodes);
  }
  const std::vector<DetailPhoto> normals = film_normals(main, motion, extent);
  const auto solve = [&](int64_t widest, double blur) {
    const FilmViews views = film_views(motion, widest, blur, normals);
    for (std::vector<PhotometricAdjustment>* tried : {&as_rigid, &as_bent}) {
      for (PhotometricAdjustment& adjustment : *tried) {
        adjustment.observe(views);
        adjustment.solve(options_.adjust);
      }
    }
  };
  for (double blur = capture_.train.front().camera.width / blurs_across; blur >= 1; blur /= 2) solve(1, blur);
  solve(widest_photograph, 0);
  const std::optional<std::vector<Vec3<double>>> eyes = positions_of_single_cameras(capture_, motion);
  for (size_t b = 0; b < bodies.size(); ++b) {
    Adjusted& result = adjusted[b];
    result.as_rigid = as_rigid[b].mean_texture_cost();
    result.as_bent = as_bent[b].mean_texture_cost();
    if (!eyes) continue;
    const std::vector<double> ratios = standing_ratios(*eyes, result.motion, result.nodes, result.body);
    rescale_bent_body(ratios, *eyes, result.body, result.motion, result.nodes);
  }
  return adjusted;
}

std::vector<double> Tracker::distance_ratios(const Surfels& main, const Motion& motion, float extent,
                                             const PoseSteps& steps, const TextureTrust& trust) const {
  constexpr double most = 1.1;       // larger ratios come from errors of the first view
  constexpr double unknown = 0.004;  // true poses have ratios of up to 1.003
  Motion moved = motion;
  PoseSolver solver = this->solver(main, nullptr, moved, 0, extent, widest_for_sizes);
  const LooseTurns loose = loosen(solver, motion, trust);
  solver.solve(weights(motion, trust, loose), steps);
  const Vec3<double> eye(capture_.train[views_at(motion, 0).front()].camera.position);
  const auto distance = [&](const Motion& of, int64_t b) {
    return length(load3<double>(of.centre.row(b)) + load3<double>(&of.shift(b, 0, 0)) - eye);
  };
  std::vector<double> ratios;
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const double ratio = std::clamp(distance(moved, b) / distance(motion, b), 1 / most, most);
    ratios.push_back(ratio - std::clamp(ratio - 1, -unknown, unknown));
  }
  return ratios;
}

std::vector<double> Tracker::distances_by_points(const Surfels& main, const Motion& motion,
                                                 float extent) const {
  const View& first = capture_.train[views_at(motion, 0).front()];
  const BodySurface surface = draw_bodies(drawn_camera(first, widest_for_sizes), motion, 0, main,
                                          raster_for_tracking(render_, extent));
  return distance_by_points(surface, capture_.points, motion.bodies());
}

void Tracker::follow(const Surfels& main, Motion& motion, int64_t key, float extent,
                     TextureTrust& trust) const {
  predict(motion, key);
  const TrackWeights geometry = weights(motion, {}, {});
  PoseSolver solver = this->solver(main, nullptr, motion, key, extent);
  // Without a mask the key keeps the extrapolated poses.
  if (solver.targets().empty()) return;
  const PoseSteps steps{options_.steps, options_.blur};
  if (options_.colour == 0) {
    solver.solve(geometry, steps);
    find_lost_bodies(solver, main, motion, key, geometry, steps);
    return;
  }
  if (trust.turned.empty()) trust = TextureTrust::of(motion.bodies());
  const std::vector<SymmetricEigen<3, double>> stiffness = solver.turn_stiffness(geometry);
  trust.add_stiffness(stiffness);
  const LooseTurns loose = trust.loose_turns(stiffness), by_texture = trust.without_mirrors(loose);
  if (any_turns(loose)) centre_loose_bodies(solver.turn_centres(geometry), loose, key, motion);
  hold_mirrors(motion, key, loose, trust);
  solver.refresh();
  solver.loosen(loose, by_texture);
  solver.solve(geometry, steps);
  find_lost_bodies(solver, main, motion, key, geometry, steps);
  std::vector<EarlierView> earlier;
  if (any_turns(by_texture) || has_tracks()) earlier = earlier_views(main, motion, key, extent);
  if (seek_turns(earlier, motion, key, by_texture)) {
    earlier = earlier_views(main, motion, key, extent);
    solver.refresh();
  }
  compare_photographs(solver, earlier, motion, key, by_texture);
  compare_tracks(solver, earlier, motion, key);
  const std::vector<Vec3<double>> by_colour = solver.turns_by_colour(), by_tracks = solver.turns_by_tracks();
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    // Only up to the previous key, so that an error at this key does not count as a rotation that texture
    // undoes.
    Vec3<double> turn = turn_between(motion, b, std::max<int64_t>(0, key - keys_for_trust), key - 1);
    turn *= most_judged / std::max(most_judged, length(turn));
    trust.taken_back_by_colour[b] -= dot(by_colour[static_cast<size_t>(b)], turn);
    trust.taken_back_by_tracks[b] -= dot(by_tracks[static_cast<size_t>(b)], turn);
    trust.turned[b] += dot(turn, turn);
  }
  const TrackWeights all = weights(motion, trust, loose);
  bool any = any_turns(by_texture);
  for (int64_t b = 0; b < motion.bodies(); ++b)
    any = any || all.colour[static_cast<size_t>(b)] > 0 || all.tracks[static_cast<size_t>(b)];
  constexpr double little_blur = 1;  // pixels
  if (any) solver.solve(all, {options_.steps / 2, little_blur});
  look_for_mirror_images(earlier, motion, key, by_texture, trust);
}

Tracker::Refollowed Tracker::follow_again(const Surfels& main, Motion motion, int64_t key, int64_t body,
                                          float extent) const {
  const TrackWeights geometry = weights(motion, {}, {});
  const PoseSteps steps{options_.steps, options_.blur};
  Refollowed result;
  for (int64_t k = 1; k <= key; ++k) {
    predict(motion, k);
    PoseSolver poses = solver(main, nullptr, motion, k, extent);
    poses.solve(geometry, steps);
    result.cost += poses.cost(geometry);
    for (const TrackTarget& target : poses.targets()) {
      for (const SurfacePoint& shown : draw_bodies(target.camera, motion, k, main, poses.drawing()).points)
        result.pixels += shown.body == body ? 1 : 0;
    }
  }
  result.motion = std::move(motion);
  return result;
}

int64_t Tracker::part_bodies(Surfels& main, int64_t points, Motion& motion, int64_t key, float extent) const {
  // Cost per pixel of the part. Parts of one rigid thing gain up to 0.03.
  constexpr double least_gain = 0.05;
  constexpr int64_t most_bodies = 8;
  const TrackWeights geometry = weights(motion, {}, {});
  const int64_t before = motion.bodies();
  for (int32_t body = 0; body < before; ++body) {
    const std::vector<std::vector<int64_t>> parts = separate_parts(main, points, body);
    if (parts.empty()) continue;
    double together = 0;
    for (int64_t k = 1; k <= key; ++k) together += solver(main, nullptr, motion, k, extent).cost(geometry);
    for (size_t p = 1; p < parts.size() && motion.bodies() < most_bodies; ++p) {
      Surfels parted = main;
      Refollowed apart =
          follow_again(parted, with_part(motion, body, parts[p], parted), key, motion.bodies(), extent);
      if (!(together - apart.cost > least_gain * apart.pixels)) continue;
      // Solving poses again lowers the cost by itself.
      const double as_one = follow_again(main, motion, key, body, extent).cost;
      if (!(as_one - apart.cost > least_gain * apart.pixels)) continue;
      // Background that was taken for the thing gains as much if no body has it.
      Surfels without = main;
      for (const int64_t row : parts[p]) without.body[row] = moved_by_field;
      const Refollowed left = follow_again(without, motion, key, body, extent);
      if (!(left.cost - apart.cost > least_gain * apart.pixels)) continue;
      together = apart.cost;
      main.body = parted.body;
      motion = std::move(apart.motion);
    }
  }
  return motion.bodies() - before;
}

Surfels Tracker::new_surface(const Surfels& main, Motion& motion, int64_t key, float extent, float tint,
                             int64_t limit) const {
  const PoseSolver solver = this->solver(main, nullptr, motion, key, extent);
  Surfels all = main;
  for (const TrackTarget& target : solver.targets()) {
    const int64_t left = limit - (all.count() - main.count());
    append_rows(all, traceflow::new_surface(target, motion, key, all, solver.drawing(), tint, left));
  }
  RowEdit made;
  for (int64_t i = main.count(); i < all.count(); ++i) made.keep(i);
  return edited_rows(all, PlacedEdit(made, Device::cpu));
}

}  // namespace traceflow

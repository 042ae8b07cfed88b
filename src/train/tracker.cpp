#include "train/tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "math/rotation_group.h"
#include "scene/rows.h"

namespace traceflow {

namespace {

constexpr int widest = 160;
constexpr int keys_for_speed = 3;
// How far back the turn lies that colour may take back.
constexpr int64_t keys_for_trust = 5;
// Colour is trusted where it takes back less than such a share of the turns, of which there were enough.
constexpr double most_taken_back = 0.15;
constexpr double enough_turned = 0.06;  // radians², Σ over times: as one turn of 14 degrees

// Average of factor × factor pixels.
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

// The turn of a body from one key to another, radians about world axes.
Vec3<double> turn_between(const Motion& motion, int64_t body, int64_t first, int64_t last) {
  const Vec4<double> from = unit_quaternion(load4<double>(&motion.rotation(body, first, 0)));
  const Vec4<double> to = unit_quaternion(load4<double>(&motion.rotation(body, last, 0)));
  return quaternion_log(quaternion_product(to, quaternion_conjugate(from)));
}

}  // namespace

bool ColourTrust::holds(int64_t body) const {
  return !turned.empty() && turned[body] > enough_turned && taken_back[body] < most_taken_back * turned[body];
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

TrackTarget Tracker::target_of(const View& view) const {
  const std::shared_ptr<const ViewImages> images = load_images(capture_, view);
  const int64_t factor = (view.camera.width + widest - 1) / widest;
  TrackTarget target;
  target.camera = view.camera;
  if (images->coverage.empty()) return target;
  target.is_shrunk = factor > 1;
  const auto shrunk = static_cast<float>(factor);
  target.camera.width = view.camera.width / static_cast<int>(factor);
  target.camera.height = view.camera.height / static_cast<int>(factor);
  for (float* length :
       {&target.camera.focal_x, &target.camera.focal_y, &target.camera.centre_x, &target.camera.centre_y})
    *length /= shrunk;
  target.coverage = smaller(images->coverage, 1, factor);
  target.colour = smaller(images->colour, 3, factor);
  target.mask.resize(target.coverage.shape());
  for (int64_t i = 0; i < target.mask.size(); ++i) target.mask[i] = target.coverage[i] >= 0.5F ? 1 : 0;
  if (images->normal_prior.empty()) return target;
  target.normal_prior = smaller(images->normal_prior, 3, factor);
  for (int64_t i = 0; i < target.normal_prior.size(); i += 3) {
    const Vec3<float> n = load3<float>(&target.normal_prior[i]);
    const float length = glm::length(n);
    store3(&target.normal_prior[i], length > 0.5F ? n / length : Vec3<float>(0));
  }
  return target;
}

PoseSolver Tracker::solver(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key,
                           float extent) const {
  std::vector<TrackTarget> targets;
  for (const View& view : capture_.train) {
    if (view.time != motion.time[key]) continue;
    TrackTarget target = target_of(view);
    if (!target.coverage.empty()) targets.push_back(std::move(target));
  }
  PoseSolver solver(main, nodes, motion, key, render_.raster_options(extent), std::move(targets));
  solver.turn_priors();
  return solver;
}

TrackWeights Tracker::weights(const Motion& motion, const ColourTrust& trust) const {
  TrackWeights weights{options_.silhouette, options_.normal, {}};
  for (int64_t b = 0; b < motion.bodies(); ++b)
    weights.colour.push_back(trust.holds(b) ? options_.colour : 0.0F);
  return weights;
}

void Tracker::solve(const Surfels& main, const Nodes* nodes, Motion& motion, int64_t key, float extent,
                    const PoseSteps& steps, const ColourTrust& trust) const {
  PoseSteps held = steps;
  held.hold_depth = steps.hold_depth || key == 0;
  solver(main, nodes, motion, key, extent).solve(weights(motion, trust), held);
}

void Tracker::follow(const Surfels& main, Motion& motion, int64_t key, float extent,
                     ColourTrust& trust) const {
  predict(motion, key);
  PoseSolver solver = this->solver(main, nullptr, motion, key, extent);
  solver.solve(weights(motion, {}), {options_.steps, options_.blur});
  if (options_.colour == 0) return;
  if (trust.turned.empty()) {
    trust.turned.reset({motion.bodies()});
    trust.taken_back.reset({motion.bodies()});
  }
  const std::vector<Vec3<double>> back = solver.turns_by_colour();
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const Vec3<double> turn = turn_between(motion, b, std::max<int64_t>(0, key - keys_for_trust), key);
    trust.taken_back[b] -= dot(back[static_cast<size_t>(b)], turn);
    trust.turned[b] += dot(turn, turn);
  }
  constexpr double little_blur = 1;  // pixels
  const TrackWeights all = weights(motion, trust);
  const bool any = std::any_of(all.colour.begin(), all.colour.end(), [](float weight) { return weight > 0; });
  if (any) solver.solve(all, {options_.steps / 2, little_blur});
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

#include "train/initialise.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "capture/image_cache.h"
#include "math/activation.h"
#include "math/rotation.h"
#include "math/rotation_group.h"
#include "math/spherical_harmonics.h"
#include "math/symmetric_eigen.h"
#include "scene/neighbours.h"
#include "scene/rows.h"
#include "track/bodies.h"
#include "track/common_view.h"
#include "track/true_poses.h"
#include "train/initial_observations.h"

namespace traceflow {

namespace {

constexpr int neighbours_for_scale = 3;
constexpr int neighbours_for_normal = 10;
// Coincident neighbours would give a scale of zero, whose logarithm is not finite.
constexpr float least_distance2 = 1e-10F;

float logit(float p) { return std::log(p / (1 - p)); }

Surfels empty_surfels(int64_t count, int degree, bool tint) {
  Surfels s;
  s.position.reset({count, 3});
  s.log_scale.reset({count, 2});
  s.rotation.reset({count, 4});
  s.opacity_logit.reset({count});
  s.sh.reset({count, sh_coefficients(degree), 3});
  if (tint) s.tint_logit.reset({count});
  return s;
}

void set_scales_from_neighbours(Surfels& s) {
  const Tensor<float> log_scale = log_spacing(s.position);
  for (int64_t i = 0; i < s.count(); ++i) s.log_scale(i, 0) = s.log_scale(i, 1) = log_scale[i];
}

void set_random_rotations(Surfels& s, Random& random) {
  for (float& q : s.rotation.values()) q = static_cast<float>(random.normal());
}

void set_rotations_from_neighbours(Surfels& s) {
  const Neighbours near = nearest_neighbours(s.position, neighbours_for_normal);
  parallel_for("initialise: normals", s.count(), [&](int64_t i) {
    Vec3<double> mean(0);
    std::array<Vec3<double>, neighbours_for_normal + 1> around{};
    around[0] = load3<double>(s.position.row(i));
    for (int k = 0; k < neighbours_for_normal; ++k) {
      around[static_cast<size_t>(k) + 1] = load3<double>(s.position.row(std::max(0, near.index(i, k))));
    }
    for (const auto& x : around) mean += x / static_cast<double>(around.size());
    Mat3<double> covariance(0);
    for (const auto& x : around) covariance += outerProduct(x - mean, x - mean);
    const Vec4<float> q = quaternion_towards(Vec3<float>(symmetric_eigen(covariance).vectors[0]));
    std::copy_n(&q[0], 4, s.rotation.row(i));
  });
}

// Unobserved surfels stay grey.
void set_colours(Surfels& s, const InitialObservations& observations) {
  for (int64_t i = 0; i < s.count(); ++i) {
    if (!observations.any[static_cast<size_t>(i)]) continue;
    for (int64_t c = 0; c < 3; ++c) {
      s.sh(i, 0, c) = (observations.colour(i, c) - 0.5F) / static_cast<float>(sh_c0);
    }
  }
}

void set_tint_from_masks(Surfels& s, const InitialObservations& observations, const InitialOptions& options) {
  for (int64_t i = 0; i < s.count(); ++i) {
    const bool on_object = observations.outside[static_cast<size_t>(i)] < 0;
    s.tint_logit[i] = logit(on_object ? options.tint_in_mask : options.tint_outside_mask);
  }
}

// At most `limit` of the points, drawn without replacement, in their order.
Tensor<float> thinned(const Tensor<float>& points, int64_t limit, Random& random) {
  const int64_t count = points.dim(0);
  if (count <= limit) return points;
  Tensor<float> kept({limit, 3});
  int64_t taken = 0;
  for (int64_t i = 0; i < count; ++i) {
    if (random.below(count - i) < limit - taken) std::copy_n(points.row(i), 3, kept.row(taken++));
  }
  return kept;
}

Tensor<float> joined(const Tensor<float>& a, const Tensor<float>& b) {
  Tensor<float> both({a.dim(0) + b.dim(0), 3});
  std::copy_n(a.data(), a.size(), both.data());
  std::copy_n(b.data(), b.size(), both.data() + a.size());
  return both;
}

// The range of one coordinate without its outermost half per cent on either side.
Vec2<float> robust_range(std::vector<float> values) {
  std::sort(values.begin(), values.end());
  const size_t cut = values.size() / 200;
  return {values[cut], values[values.size() - 1 - cut]};
}

void take_true_poses(const Capture& capture, Scene& scene) {
  const std::optional<MotionTruth> truth = load_motion_truth(capture);
  if (!truth) {
    throw InputError(capture.folder.string(), "truth/motion", "none", "the true motion",
                     "leave deform.track.true_poses off");
  }
  if (scene.main_motion) set_true_poses(*truth, capture.normalisation, scene.main, *scene.main_motion);
}

float smallest_focal(const std::vector<View>& views) {
  float smallest = 0;
  for (const View& view : views) {
    const float focal = std::min(view.camera.focal_x, view.camera.focal_y);
    if (smallest == 0 || focal < smallest) smallest = focal;
  }
  return smallest;
}

}  // namespace

Tensor<float> finite_points(const Tensor<float>& points) {
  if (points.empty()) return Tensor<float>({0, 3});
  Tensor<float> kept(points.shape());
  int64_t count = 0;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const float* p = points.row(i);
    if (std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]))
      std::copy_n(p, 3, kept.row(count++));
  }
  kept.resize({count, 3});
  return kept;
}

Tensor<float> log_spacing(const Tensor<float>& points) {
  const Neighbours near = nearest_neighbours(points, neighbours_for_scale);
  Tensor<float> result({points.dim(0)});
  for (int64_t i = 0; i < result.size(); ++i) {
    float sum = 0;
    for (int k = 0; k < neighbours_for_scale; ++k) sum += near.distance2(i, k);
    result[i] = 0.5F * std::log(std::max(sum / neighbours_for_scale, least_distance2));
  }
  return result;
}

Surfels surfels_at_points(const Tensor<float>& points, const InitialOptions& options, Random& random) {
  Surfels s = empty_surfels(points.dim(0), options.sh_degree, true);
  s.position = points;
  set_scales_from_neighbours(s);
  if (options.normals_from_points && s.count() > neighbours_for_normal) {
    set_rotations_from_neighbours(s);
  } else {
    set_random_rotations(s, random);
  }
  s.opacity_logit.fill(logit(options.opacity));
  s.tint_logit.fill(logit(options.tint));
  if (options.roughness > 0) {
    s.roughness_logit.reset({s.count()});
    s.roughness_logit.fill(roughness_logit(options.roughness));
  }
  return s;
}

Surfels surfels_around(const Tensor<float>& points, const std::vector<View>& views, int64_t limit,
                       const InitialOptions& options, Random& random) {
  Vec3<float> low(0);
  Vec3<float> high(0);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (int64_t i = 0; i < points.dim(0); ++i) values.push_back(points(i, axis));
    const Vec2<float> range = robust_range(std::move(values));
    low[axis] = range[0];
    high[axis] = range[1];
  }
  for (const View& view : views) {
    low = glm::min(low, view.camera.position);
    high = glm::max(high, view.camera.position);
  }
  const Vec3<float> centre = 0.5F * (low + high);
  const Vec3<float> size = options.environment_box * (high - low);

  const int cells = options.environment_cells;
  const int64_t places = static_cast<int64_t>(cells) * cells * cells * options.environment_per_cell;
  const int64_t count = std::min(places, limit);
  // If there are more places than surfels, each surfel takes a random place of its share. An even step could
  // align with the grid.
  const auto place_of = [&](int64_t i) {
    if (count == places) return i;
    const double share = static_cast<double>(places) / static_cast<double>(count);
    const double place = (static_cast<double>(i) + random.uniform()) * share;
    return std::min(places - 1, static_cast<int64_t>(place));
  };
  Surfels s = empty_surfels(count, options.environment_sh_degree, false);
  for (int64_t i = 0; i < count; ++i) {
    const int64_t cell = place_of(i) / options.environment_per_cell;
    const glm::vec<3, int64_t> corner(cell % cells, cell / cells % cells, cell / cells / cells);
    // Braces, because only they fix the order of the draws.
    const Vec3<float> offset{random.uniform(), random.uniform(), random.uniform()};
    store3(s.position.row(i),
           centre + size * ((Vec3<float>(corner) + offset) / static_cast<float>(cells) - 0.5F));
  }
  set_scales_from_neighbours(s);
  set_random_rotations(s, random);
  s.opacity_logit.fill(logit(options.environment_opacity));
  return s;
}

Surfels surroundings_at_points(const Capture& capture, const Tensor<float>& points, int64_t limit,
                               const InitialOptions& options, Random& random) {
  InitialOptions as_environment = options;
  as_environment.sh_degree = options.environment_sh_degree;
  Surfels s = surfels_at_points(thinned(points, limit, random), as_environment, random);
  s.tint_logit = s.roughness_logit = {};
  // The object mirrors what the camera sees beside it.
  const InitialObservations observations = observe(s, earliest_photographs(capture));
  set_colours(s, observations);
  RowEdit surroundings;
  for (int64_t i = 0; i < s.count(); ++i) {
    if (observations.outside[static_cast<size_t>(i)] > 0) surroundings.keep(i);
  }
  edit_rows(s, surroundings);
  return s;
}

float half_diagonal(const Tensor<float>& points) {
  if (points.empty()) return 1;
  Vec3<float> size(0);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (int64_t i = 0; i < points.dim(0); ++i) values.push_back(points(i, axis));
    const Vec2<float> range = robust_range(std::move(values));
    size[axis] = range[1] - range[0];
  }
  return 0.5F * glm::length(size);
}

float cloud_radius(const Tensor<float>& points) {
  const Tensor<float> finite = finite_points(points);
  const auto count = static_cast<size_t>(finite.dim(0));
  if (count == 0) return 1;
  const auto pick = [](std::vector<float>& values, size_t place) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(place), values.end());
    return values[place];
  };
  std::vector<float> values(count);
  Vec3<float> median(0);
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < count; ++i) values[i] = finite(static_cast<int64_t>(i), axis);
    median[axis] = pick(values, count / 2);
  }
  for (size_t i = 0; i < count; ++i) {
    values[i] = glm::length(load3<float>(finite.row(static_cast<int64_t>(i))) - median);
  }
  return pick(values, (count - 1) * 9 / 10);
}

bool shows_objects(const Capture& capture) {
  if (!capture.masks_are_found && (!capture.has_masks || capture.masks_are_estimated)) return false;
  return std::any_of(capture.train.begin(), capture.train.end(),
                     [&](const View& view) { return capture.images->has_mask(view.id); });
}

bool follows_bodies(const Capture& capture, const TrainOptions& options) {
  return options.deform.main && options.deform.kind == "nodes" && shows_objects(capture);
}

InitialScene initial_scene(const Capture& capture, const TrainOptions& options, Random& random) {
  const int64_t limit = std::min(options.initial.max_points, options.density.max_surfels);
  // Main surfels need photographs to train. A mirror may show the other points, so the environment uses all.
  Tensor<float> points = finite_points(capture.points);
  Tensor<float> seen =
      points_in_view(points, capture.train, options.render.raster_options(capture.extent).near_plane);
  InitialScene made{{}, points.dim(0), seen.dim(0), 0};
  if (seen.dim(0) == 0) {
    constexpr int64_t random_points = 100000;
    seen = points_in_common_view(capture.train, capture.extent, std::min(limit, random_points), random);
    points = seen;
  }
  if (points.dim(0) == 0) {
    throw InputError(capture.folder.string(), "points", "none, and no place that several views see",
                     "points to start from", "add points.npy (P×3, capture units)");
  }
  Scene& scene = made.scene;
  scene.specular = options.specular;
  scene.normalisation = capture.normalisation;
  scene.extent = capture.extent;
  scene.focal = smallest_focal(capture.train);
  Tensor<float> made_up({0, 3});
  if (made.points_in_view > 0 && follows_bodies(capture, options))
    made_up = thinned(points_on_bare_things(capture, seen), limit / 2, random);
  const Tensor<float> kept = thinned(seen, limit - made_up.dim(0), random);
  made.at_points = kept.dim(0);
  scene.main = surfels_at_points(joined(kept, made_up), options.initial, random);
  // Estimated masks show what moves, not what reflects. In videos without mirrors, surfels that started as
  // mirrors grew into a mirror in front of the camera, which can show any scene.
  const bool by_masks = options.initial.tint_in_mask > 0 && capture.has_masks &&
                        !capture.masks_are_estimated && !capture.masks_are_found;
  if (options.initial.colours_from_views || by_masks) {
    const InitialObservations observations = observe(scene.main, earliest_photographs(capture));
    if (options.initial.colours_from_views) set_colours(scene.main, observations);
    if (by_masks) set_tint_from_masks(scene.main, observations, options.initial);
  }
  if (follows_bodies(capture, options)) scene.main_motion = find_bodies(capture, made.at_points, scene.main);
  if (options.deform.track.true_poses) take_true_poses(capture, scene);
  if (scene.main_motion) make_solid(*scene.main_motion, scene.main);
  if (options.deform.main)
    scene.main_field = make_field(options.deform.network, residual::main_outputs, random);

  if (options.specular == Specular::environment_gaussians) {
    const int64_t cap = options.environment_density.max_surfels;
    scene.environment = surfels_around(points, capture.train, cap, options.initial, random);
    const int64_t room = cap - scene.environment.count();
    const int64_t copies = std::min<int64_t>(options.initial.environment_points, room);
    if (copies > 0 && (capture.has_masks || capture.masks_are_found)) {
      append_rows(scene.environment,
                  surroundings_at_points(capture, points, copies, options.initial, random));
    }
    if (options.deform.environment) {
      scene.environment_field =
          make_field(options.deform.environment_network, residual::environment_outputs, random);
    }
    if (const int64_t side = options.initial.far_size; side > 0) {
      scene.environment_map.emplace();
      scene.environment_map->logit.reset({6 * side, side, 3});
    }
  } else if (options.specular == Specular::environment_map) {
    scene.environment_map.emplace();
    scene.environment_map->logit.reset({6L * options.initial.map_size, options.initial.map_size, 3});
    if (options.deform.environment) {
      scene.environment_map->field = make_field(options.deform.environment_network, 3, random);
    }
  }
  return made;
}

}  // namespace traceflow

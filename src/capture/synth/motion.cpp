#include <algorithm>
#include <vector>

#include "capture/synth/scenes.h"
#include "capture/synth/synth.h"
#include "capture/synth/trace.h"

namespace traceflow {

namespace {

using synth::Vector;

// Rays over the first image, whatever its size, and the limit of kept points per object.
constexpr int64_t ray_columns = 480;
constexpr int64_t ray_rows = 270;
constexpr size_t most_of_an_object = 600;

struct Followed {
  size_t body;
  Vector rest;
  int triangle;
};

// For each object, the points that the camera sees, in the order of rays.
std::vector<std::vector<Followed>> seen_points(const synth::Stage& stage, const Camera<double>& camera) {
  std::vector<std::vector<Followed>> objects;
  for (int64_t i = 0; i < ray_rows * ray_columns; ++i) {
    const int64_t row = i / ray_columns;
    const int64_t column = i % ray_columns;
    const double x = (static_cast<double>(column) + 0.5) / ray_columns * camera.width;
    const double y = (static_cast<double>(row) + 0.5) / ray_rows * camera.height;
    const auto hit = synth::nearest_hit(stage, {camera.position, normalize(camera.ray_in_world(x, y))});
    if (!hit) continue;
    const auto body = static_cast<size_t>(hit->body);
    if (stage.bodies[body].object < 0) continue;
    const auto object = static_cast<size_t>(stage.bodies[body].object);
    if (objects.size() <= object) objects.resize(object + 1);
    objects[object].push_back({body, hit->rest, hit->triangle});
  }
  return objects;
}

// An evenly spaced selection if there are too many.
std::vector<Followed> thinned(const std::vector<Followed>& points) {
  if (points.size() <= most_of_an_object) return points;
  std::vector<Followed> kept;
  for (size_t i = 0; i < most_of_an_object; ++i)
    kept.push_back(points[i * points.size() / most_of_an_object]);
  return kept;
}

}  // namespace

SynthMotion synth_motion(const SynthOptions& options) {
  const synth::AnimatedScene scene = synth::make_scene(options.scene);
  std::vector<SynthView> views = synth_views(options);
  std::erase_if(views, [](const SynthView& view) { return view.is_test; });

  const auto seen = seen_points(scene.at(0), views.front().camera);
  std::vector<Followed> followed;
  std::vector<int32_t> object_of;
  for (size_t object = 0; object < seen.size(); ++object) {
    const std::vector<Followed> kept = thinned(seen[object]);
    followed.insert(followed.end(), kept.begin(), kept.end());
    object_of.insert(object_of.end(), kept.size(), static_cast<int32_t>(object));
  }

  SynthMotion motion;
  const auto count = static_cast<int64_t>(followed.size());
  motion.points.reset({static_cast<int64_t>(views.size()), count, 3});
  motion.object.reset({count});
  std::ranges::copy(object_of, motion.object.data());
  for (size_t frame = 0; frame < views.size(); ++frame) {
    const synth::Stage stage = scene.at(views[frame].time);
    for (int64_t i = 0; i < count; ++i) {
      const Followed& point = followed[static_cast<size_t>(i)];
      const Vector now = synth::point_in_world(stage.bodies[point.body], point.rest, point.triangle);
      store3(&motion.points(static_cast<int64_t>(frame), i, 0), now);
    }
  }
  return motion;
}

}  // namespace traceflow

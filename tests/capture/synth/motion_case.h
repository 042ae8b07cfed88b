#pragma once

#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "capture/synth/scenes.h"
#include "capture/synth/synth.h"
#include "capture/synth/trace.h"

// What the tests of synthetic motion ask of a scene.
namespace traceflow {

inline SynthOptions motion_options(SynthScene scene) {
  SynthOptions options;
  options.scene = scene;
  options.frames = 25;
  options.width = 120;
  options.height = 67;
  options.samples = 1;
  return options;
}

inline std::vector<SynthView> training_views(const SynthOptions& options) {
  std::vector<SynthView> views = synth_views(options);
  std::erase_if(views, [](const SynthView& view) { return view.is_test; });
  return views;
}

inline synth::Vector point_at(const SynthMotion& motion, int64_t frame, int64_t i) {
  return load3<double>(&motion.points(frame, i, 0));
}

// For each object the indices of its points.
inline std::map<int, std::vector<int64_t>> points_of(const SynthMotion& motion) {
  std::map<int, std::vector<int64_t>> objects;
  for (int64_t i = 0; i < motion.object.size(); ++i) objects[motion.object[i]].push_back(i);
  return objects;
}

// What the camera sees where the point is; nothing where something hides it.
inline std::optional<synth::Hit> seen_at(const synth::Stage& stage, const SynthView& view,
                                         const synth::Vector& point) {
  const synth::Vector offset = point - view.camera.position;
  const auto hit = synth::nearest_hit(stage, {view.camera.position, normalize(offset)});
  return hit && std::abs(hit->distance - length(offset)) < 1e-5 ? hit : std::nullopt;
}

// All crossings of a ray with a closed shape.
inline std::vector<double> crossings(const synth::Shape& shape, const synth::Ray& ray) {
  std::vector<double> found;
  double t = synth::hit_distance(shape, ray);
  for (; t != synth::infinity && found.size() < 1000; t = synth::hit_distance(shape, ray, t + 1e-9))
    found.push_back(t);
  return found;
}

}  // namespace traceflow

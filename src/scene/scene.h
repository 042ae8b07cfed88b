#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "scene/environment_map.h"
#include "scene/field.h"
#include "scene/lighting.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/normalisation.h"
#include "scene/surfels.h"

namespace traceflow {

// Where reflections come from (method §9).
enum class Specular { none, environment_gaussians, environment_map };
constexpr std::array<std::string_view, 3> enum_names(Specular) {
  return {"none", "environment-gaussians", "environment-map"};
}

// What is reconstructed (method §1): two sets of surfels and a residual field for each, or a cube map in the
// place of the second set. A field that is absent is F ≡ 0; a motion that is absent carries nothing.
struct Scene {
  Surfels main;
  Surfels environment;
  std::optional<Field> main_field;
  std::optional<Motion> main_motion;  // of the bodies that main.body names
  std::optional<Nodes> main_nodes;    // of those of them that bend
  std::optional<Lighting> lighting;   // of main surfels that no body carries
  std::optional<Field> environment_field;
  std::optional<EnvironmentMap> environment_map;
  Specular specular = Specular::environment_gaussians;
  SceneNormalisation normalisation;
  float extent =
      1;  // 1.1 · the largest distance of a training camera from their mean (method §7.6), scene units
  // Smallest focal length of the photographs that it was trained on, pixels; 0 where nobody knows.
  float focal = 0;
  // One number: the largest distance by which the main field lately moved a surfel, what view culling must
  // allow for. Those that bodies carry are never culled.
  Tensor<float> main_max_displacement{Shape{1}};

  // Where all of it lives.
  Device device() const { return main.device(); }
  // Takes all of it to a device. What cannot go there stays where it is, whole (memory::OutOfMemory).
  void move_to(Device device);
};

}  // namespace traceflow

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

// Source of the reflections (method §9).
enum class Specular { none, environment_gaussians, environment_map };
constexpr std::array<std::string_view, 3> enum_names(Specular) {
  return {"none", "environment-gaussians", "environment-map"};
}

// What is reconstructed (method §1): two sets of surfels with a residual field each, or a cube map instead of
// the second set. An absent field is F ≡ 0; an absent motion moves nothing.
struct Scene {
  Surfels main;
  Surfels environment;
  std::optional<Field> main_field;
  std::optional<Motion> main_motion;  // of the bodies in main.body
  std::optional<Nodes> main_nodes;    // of those bodies that bend
  std::optional<Lighting> lighting;   // of main surfels that belong to no body, and of bodies
  std::optional<Field> environment_field;
  std::optional<EnvironmentMap> environment_map;
  Specular specular = Specular::environment_gaussians;
  SceneNormalisation normalisation;
  float extent =
      1;  // 1.1 · the largest distance of a training camera from their mean (method §7.6), scene units
  // Smallest focal length of the photographs that the scene was trained on, pixels; 0 if unknown.
  float focal = 0;
  // One number: the largest recent distance by which the main field moved a surfel, the margin of view
  // culling. Surfels of bodies are never culled.
  Tensor<float> main_max_displacement{Shape{1}};

  // The device of all parts.
  Device device() const { return main.device(); }
  // Moves all parts to a device. A part that does not fit there stays where it is, complete
  // (memory::OutOfMemory).
  void move_to(Device device);
};

}  // namespace traceflow

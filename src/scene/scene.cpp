#include "scene/scene.h"

namespace traceflow {

void Scene::move_to(Device device) {
  const auto move = [&](auto& part) { part = part.on(device); };
  move(main);
  move(environment);
  if (main_field) move(*main_field);
  if (main_motion) move(*main_motion);
  if (main_nodes) move(*main_nodes);
  if (lighting) move(*lighting);
  if (environment_field) move(*environment_field);
  if (environment_map) move(*environment_map);
  move(main_max_displacement);
}

}  // namespace traceflow

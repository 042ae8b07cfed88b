#pragma once

#include "files/safetensors.h"
#include "scene/scene.h"

namespace traceflow {

// Stores the scene in a checkpoint: tensors under "scene/…" and one JSON string of metadata under "scene".
void put_scene(const Scene& scene, Safetensors& file);
// Throws InputError with the name of a tensor that is missing or has the wrong shape.
Scene get_scene(const Safetensors& file);

// Stores one parameter set, also for tensors of the same shapes (gradients, moments).
template <class T>
void put_surfels(const BasicSurfels<T>& surfels, const std::string& prefix, Safetensors& file) {
  surfels.for_each(
      [&](const std::string& name, const Tensor<T>& tensor) { file.add(prefix + name, tensor); });
}

}  // namespace traceflow

#pragma once

#include "files/safetensors.h"
#include "scene/scene.h"

namespace traceflow {

// The scene's part of a checkpoint: tensors under "scene/…" and one JSON string of metadata under "scene".
void put_scene(const Scene& scene, Safetensors& file);
// Throws InputError naming the tensor that is missing or has the wrong shape.
Scene get_scene(const Safetensors& file);

// One parameter set of the scene, for whoever stores something of the same shape (gradients, moments).
template <class T>
void put_surfels(const BasicSurfels<T>& surfels, const std::string& prefix, Safetensors& file) {
  surfels.for_each(
      [&](const std::string& name, const Tensor<T>& tensor) { file.add(prefix + name, tensor); });
}

}  // namespace traceflow

#pragma once

#include <string>

#include "arrays.h"
#include "math/camera.h"
#include "ops/raster/raster.h"
#include "render/frame.h"

// The layers of images by their names in Python.
namespace traceflow::python {

// Calls f(name, set.colour, …) for each layer of the rasteriser.
template <class F, class... Sets>
void for_each_raster_layer(F&& f, Sets&... sets) {
  f("colour", sets.colour...);
  f("alpha", sets.alpha...);
  f("tint", sets.tint...);
  f("silhouette", sets.silhouette...);
  f("roughness", sets.roughness...);
  f("normal", sets.normal...);
  f("depth", sets.depth...);
  f("median_depth", sets.median_depth...);
  f("distortion", sets.distortion...);
}

// Reads a dict of gradients by layers. for_each calls its argument with each name and tensor. Throws
// InputError for a name that no layer has and for a wrong shape.
template <class ForEach>
void take_layer_gradients(const py::dict& gradients, const Camera<float>& camera, const ForEach& for_each) {
  std::string names;
  for_each(
      [&](const char* name, Tensor<float>&) { names += (names.empty() ? "" : ", ") + std::string(name); });
  for (const auto& [key, value] : gradients) {
    const auto name = py::cast<std::string>(py::str(key));
    const auto array = py::reinterpret_borrow<py::object>(value);
    bool found = false;
    for_each([&](const char* layer, Tensor<float>& gradient) {
      if (name != layer) return;
      found = true;
      Dimensions shape = {camera.height, camera.width};
      if (name == "colour" || name == "normal" || name == "pseudo_normal") shape.emplace_back(3);
      gradient = *tensor_of_array<float>(array, "gradients: " + name, shape);
    });
    if (!found) throw InputError("argument", "gradients", name, "layers among " + names);
  }
}

}  // namespace traceflow::python

#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "arrays.h"
#include "render/renderer.h"
#include "runs/loaded_scene.h"
#include "viz/layers.h"
#include "viz/tracks.h"

namespace traceflow::python {

// A scene as Python holds it. Its tensors are never resized, since arrays share them.
struct HeldScene {
  LoadedScene loaded;
  // Of a training's copy, or of the run: completed iterations.
  int64_t iteration = 0;
  std::optional<Renderer> renderer = {};
  std::optional<viz::TrackFollower> follower = {};
  std::mutex rendering = {};  // one frame at a time: a renderer reuses its memory

  Scene& scene() { return loaded.subject.scene; }
};

// Where a picture is taken, from a View or a Camera.
struct Place {
  Camera<float> camera;  // in the units of the scene
  float time;
};
// place: a View of any capture of the scene, or a Camera; time: overrides a view's, and must be given with a
// camera. Throws InputError.
Place place_of(const SceneNormalisation& of_scene, const py::object& place, const py::object& time);

// The device of this name: auto, cpu or cuda. Throws InputError.
Device device_of(const std::string& name);

}  // namespace traceflow::python

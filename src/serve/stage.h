#pragma once

#include <string>
#include <vector>

#include "capture/capture.h"
#include "render/renderer.h"
#include "scene/scene.h"

namespace traceflow::serve {

// What is shown: a scene and how its pictures are made. Valid until the scene changes, so between two
// iterations of a training.
struct Stage {
  const Scene& scene;
  RenderOptions render;
  FrameRequest request;  // which parts of the scene take part; camera and time are each Look's own
  int64_t iteration = 0;
};

// A camera that took a photograph, in the scene's units.
struct CapturedCamera {
  std::string id;
  float time = 0;
  Camera<float> camera;
};

// What is known of a scene beside itself, and stays as it is while the scene changes.
struct Setting {
  std::string source;                // "training", "run" or "ply"
  std::string name;                  // of the run's folder or the file
  const Capture* capture = nullptr;  // photographs; null where there are none
  std::vector<CapturedCamera> train, test;
  std::vector<float> times;  // of the capture, ascending
};

// capture: may be null; else it outlives the setting, and its cameras are taken to the scene's units.
Setting make_setting(std::string source, std::string name, const Capture* capture,
                     const SceneNormalisation& scene);

}  // namespace traceflow::serve

#pragma once

#include <string>
#include <vector>

#include "capture/capture.h"
#include "render/renderer.h"
#include "scene/scene.h"

namespace traceflow::serve {

// A scene and how it is rendered. Valid until the scene changes, so between two iterations of a training.
struct SceneView {
  const Scene& scene;
  RenderOptions render;
  FrameRequest request;  // which parts of the scene are rendered; each Look has its own camera and time
  int64_t iteration = 0;
};

// A camera that took a photograph, in the scene's units.
struct CapturedCamera {
  std::string id;
  float time = 0;
  Camera<float> camera;
};

// What is known about a scene besides its surfels. It does not change while the scene is trained.
struct SceneInfo {
  std::string source;                // "training", "run" or "ply"
  std::string name;                  // of the run's folder or the file
  const Capture* capture = nullptr;  // photographs; null where there are none
  std::vector<CapturedCamera> train, test;
  std::vector<float> times;  // of the capture, ascending
};

// capture: may be null; else it outlives the SceneInfo, and its cameras are converted to the scene's units.
SceneInfo make_scene_info(std::string source, std::string name, const Capture* capture,
                          const SceneNormalisation& scene);

}  // namespace traceflow::serve

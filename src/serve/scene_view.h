#pragma once

#include <string>
#include <vector>

#include "capture/capture.h"
#include "render/renderer.h"
#include "scene/scene.h"

namespace traceflow::serve {

// A scene and its render settings. Valid until the scene changes: during training, between two iterations.
struct SceneView {
  const Scene& scene;
  RenderOptions render;
  FrameRequest request;  // the parts of the scene to render; each ViewRequest has its own camera and time
  int64_t iteration = 0;
};

// The camera of a photograph, in the scene's units.
struct CapturedCamera {
  std::string id;
  float time = 0;
  Camera<float> camera;
};

// Data of a scene besides its surfels. It does not change during training.
struct SceneInfo {
  std::string source;                // "training", "run" or "ply"
  std::string name;                  // of the run's folder or the file
  const Capture* capture = nullptr;  // photographs; null if there are none
  std::vector<CapturedCamera> train, test;
  std::vector<float> times;  // of the capture, ascending
};

// capture: may be null; else it must outlive the SceneInfo. Its cameras are converted to the scene's units.
SceneInfo make_scene_info(std::string source, std::string name, const Capture* capture,
                          const SceneNormalisation& scene);

}  // namespace traceflow::serve

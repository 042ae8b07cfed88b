#pragma once

#include <optional>
#include <string>
#include <vector>

#include "math/camera.h"

namespace traceflow::viz {

// One picture to render: camera, time and file name.
struct Shot {
  std::string name;
  std::optional<float> time;  // in [0, 1]; if absent, the caller chooses
  Camera<float> camera;       // in the scene's units
};

}  // namespace traceflow::viz

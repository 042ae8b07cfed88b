#pragma once

#include <optional>
#include <string>
#include <vector>

#include "math/camera.h"

namespace traceflow::viz {

// One picture to be taken: from where, when, and the name of its files.
struct Shot {
  std::string name;
  std::optional<float> time;  // in [0, 1]; the asker's choice where absent
  Camera<float> camera;       // in the scene's units
};

}  // namespace traceflow::viz

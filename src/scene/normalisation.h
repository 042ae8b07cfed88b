#pragma once

#include "math/types.h"

namespace traceflow {

// Converts a capture's own coordinates to those of the scene: x_in_scene = (x_in_capture - centre) · scale,
// as in scene.json (method §2).
struct SceneNormalisation {
  Vec3<double> centre{0};
  double scale = 1;

  Vec3<double> in_scene(const Vec3<double>& in_capture) const { return (in_capture - centre) * scale; }
  Vec3<double> in_capture(const Vec3<double>& in_scene) const { return in_scene / scale + centre; }
  bool operator==(const SceneNormalisation&) const = default;
};

}  // namespace traceflow

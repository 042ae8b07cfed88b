#pragma once

#include "math/camera.h"
#include "scene/normalisation.h"

namespace traceflow {

// A camera that a user can place, in the capture's own coordinates: square pixels, the principal point in the
// middle.
struct Viewpoint {
  Vec3<double> position{0};
  Mat3<double> world_from_camera{1};  // rotation
  double fov_y = 45;                  // full vertical angle, degrees
};

// The camera at this viewpoint, in scene units.
Camera<float> camera_at(const Viewpoint& viewpoint, int width, int height,
                        const SceneNormalisation& normalisation);

// The viewpoint of a camera of the scene; its principal point is assumed in the middle.
Viewpoint viewpoint_of(const Camera<float>& camera, const SceneNormalisation& normalisation);

// Converts a camera from the units of `from` to those of `to`, another scene of the same capture.
Camera<float> renormalised(Camera<float> camera, const SceneNormalisation& from,
                           const SceneNormalisation& to);

}  // namespace traceflow

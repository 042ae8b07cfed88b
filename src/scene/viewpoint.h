#pragma once

#include "math/camera.h"
#include "scene/normalisation.h"

namespace traceflow {

// A camera that anybody can place, in the capture's own lengths and axes: square pixels, the principal point
// in the middle.
struct Viewpoint {
  Vec3<double> position{0};
  Mat3<double> world_from_camera{1};  // rotation
  double fov_y = 45;                  // whole vertical angle, degrees
};

// The camera there, in the scene's units.
Camera<float> camera_at(const Viewpoint& viewpoint, int width, int height,
                        const SceneNormalisation& normalisation);

// Where a camera of the scene is; its principal point is taken to the middle.
Viewpoint viewpoint_of(const Camera<float>& camera, const SceneNormalisation& normalisation);

// A camera in the units of `from` in those of `to`, another scene of the same capture.
Camera<float> carried(Camera<float> camera, const SceneNormalisation& from, const SceneNormalisation& to);

}  // namespace traceflow

#pragma once

#include <vector>

#include "math/camera.h"
#include "scene/normalisation.h"

namespace traceflow::prepare {

// What scene.json says.
struct SceneBounds {
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;  // scene units
};

// As Nerfies has them: the scene's centre is that of the box around the cameras and the points, without the
// outermost 2.5 % of these along each axis at either end; the scale makes the box's diagonal 1. Near and far
// are the depths, in the images, between which all but a thousandth of the points lie, and a fifth more.
// Everything in one frame and unit.
SceneBounds scene_bounds(const std::vector<Vec3<double>>& points, const std::vector<Camera<double>>& cameras);

}  // namespace traceflow::prepare

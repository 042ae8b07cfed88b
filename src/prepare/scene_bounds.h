#pragma once

#include <algorithm>
#include <vector>

#include "math/camera.h"
#include "scene/normalisation.h"

namespace traceflow::prepare {

// f(point, camera) for each point and camera; where these are more than some millions, for an even share of
// the points of each camera.
template <class F>
void for_each_sampled_pair(const std::vector<Vec3<double>>& points,
                           const std::vector<Camera<double>>& cameras, F&& f) {
  constexpr size_t most = size_t{1} << 22;
  const size_t step = std::max<size_t>(1, points.size() * cameras.size() / most);
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t k = i % step; k < points.size(); k += step) f(points[k], cameras[i]);
  }
}

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

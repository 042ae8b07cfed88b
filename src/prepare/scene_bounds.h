#pragma once

#include <algorithm>
#include <vector>

#include "math/camera.h"
#include "scene/normalisation.h"

namespace traceflow::prepare {

// Calls f(point, camera) for each pair. If there are more than some millions, uses an even sample of the
// points for each camera.
template <class F>
void for_each_sampled_pair(const std::vector<Vec3<double>>& points,
                           const std::vector<Camera<double>>& cameras, F&& f) {
  constexpr size_t most = size_t{1} << 22;
  const size_t step = std::max<size_t>(1, points.size() * cameras.size() / most);
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t k = i % step; k < points.size(); k += step) f(points[k], cameras[i]);
  }
}

// The values in scene.json.
struct SceneBounds {
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;  // scene units
};

// As in Nerfies: the centre is that of the box around the cameras and the points, without the outermost 2.5 %
// at each end of each axis; the scale gives the box a diagonal of 1. Near and far enclose all but a
// thousandth of the points' depths in the images, with a margin of a fifth. All input is in one frame and
// unit.
SceneBounds scene_bounds(const std::vector<Vec3<double>>& points, const std::vector<Camera<double>>& cameras);

}  // namespace traceflow::prepare

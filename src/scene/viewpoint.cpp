#include "scene/viewpoint.h"

#include <cmath>
#include <numbers>

namespace traceflow {

Camera<float> camera_at(const Viewpoint& viewpoint, int width, int height,
                        const SceneNormalisation& normalisation) {
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  camera.focal_x = camera.focal_y = height / 2.0 / std::tan(viewpoint.fov_y * std::numbers::pi / 360);
  camera.centre_x = width / 2.0;
  camera.centre_y = height / 2.0;
  camera.camera_from_world = transpose(viewpoint.world_from_camera);
  camera.position = normalisation.in_scene(viewpoint.position);
  return convert<float>(camera);
}

Viewpoint viewpoint_of(const Camera<float>& camera, const SceneNormalisation& normalisation) {
  const double half_tangent = camera.height / (2.0 * static_cast<double>(camera.focal_y));
  return {normalisation.in_capture(Vec3<double>(camera.position)),
          transpose(Mat3<double>(camera.camera_from_world)),
          std::atan(half_tangent) * 360 / std::numbers::pi};
}

Camera<float> renormalised(Camera<float> camera, const SceneNormalisation& from,
                           const SceneNormalisation& to) {
  if (from == to) return camera;
  camera.position = Vec3<float>(to.in_scene(from.in_capture(Vec3<double>(camera.position))));
  return camera;
}

}  // namespace traceflow

#include "serve/view_camera.h"

#include <algorithm>
#include <cmath>

namespace traceflow::serve {

namespace {

int side(double pixels) { return std::max(1, static_cast<int>(std::lround(pixels))); }

}  // namespace

const CapturedCamera& captured(const PhotoRef& photo, const SceneInfo& info) {
  const std::vector<CapturedCamera>& split = photo.test ? info.test : info.train;
  if (photo.index >= static_cast<int64_t>(split.size())) {
    throw InputError("message", "photo.index", std::to_string(photo.index),
                     "one of " + std::to_string(split.size()) + " views");
  }
  return split[static_cast<size_t>(photo.index)];
}

Camera<float> resized(Camera<float> camera, int width, int height) {
  const float x = static_cast<float>(width) / static_cast<float>(camera.width);
  const float y = static_cast<float>(height) / static_cast<float>(camera.height);
  camera.width = width;
  camera.height = height;
  camera.focal_x *= x;
  camera.centre_x *= x;
  camera.focal_y *= y;
  camera.centre_y *= y;
  return camera;
}

Camera<float> camera_of(const ViewRequest& request, const SceneInfo& info,
                        const SceneNormalisation& normalisation, double divisor) {
  if (const auto* free = std::get_if<Viewpoint>(&request.camera))
    return camera_at(*free, side(request.width / divisor), side(request.height / divisor), normalisation);
  const Camera<float>& camera = captured(std::get<PhotoRef>(request.camera), info).camera;
  double fit = std::min(request.width / static_cast<double>(camera.width),
                        request.height / static_cast<double>(camera.height));
  // A difference is never larger than the photograph, since the added pixels would be interpolated.
  if (request.layer == "difference") fit = std::min(fit, 1.0);
  fit /= divisor;
  return resized(camera, side(camera.width * fit), side(camera.height * fit));
}

}  // namespace traceflow::serve

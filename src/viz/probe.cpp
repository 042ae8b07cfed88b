#include "viz/probe.h"

#include <cmath>

namespace traceflow::viz {

namespace {

// A camera with only one pixel of another camera's image.
Camera<float> camera_of_pixel(Camera<float> camera, double x, double y) {
  camera.centre_x -= static_cast<float>(std::floor(x));
  camera.centre_y -= static_cast<float>(std::floor(y));
  camera.width = camera.height = 1;
  return camera;
}

float number(const Tensor<float>& values) { return values.on(Device::cpu)[0]; }
Vec3<float> vector(const Tensor<float>& values) { return load3<float>(values.on(Device::cpu).data()); }

// A list that contains only the first pixel, on the frame's device.
Tensor<int32_t> first_pixel(Device device) { return Tensor<int32_t>(Shape{1}, device); }

ProbeResult::Mirrored mirrored_of(const MirroredRays& from) {
  ProbeResult::Mirrored mirrored;
  mirrored.direction = vector(from.rays.directions);
  mirrored.alpha = from.alpha.empty() ? 0 : number(from.alpha);
  mirrored.distance = from.distance.empty() ? 0 : number(from.distance);
  mirrored.end = vector(from.rays.origins) + mirrored.distance * mirrored.direction;
  return mirrored;
}

}  // namespace

std::optional<ProbeResult> probe(Renderer& renderer, const Scene& scene, const FrameRequest& request,
                                 double x, double y) {
  if (!(x >= 0 && x < request.camera.width && y >= 0 && y < request.camera.height)) return std::nullopt;
  FrameRequest one = request;
  one.camera = camera_of_pixel(request.camera, x, y);
  const Frame& frame = renderer.forward(scene, one);

  ProbeResult result;
  result.alpha = number(frame.raster.alpha);
  const Vec3<float> normal = vector(frame.raster.normal);
  const float length2 = dot(normal, normal);
  if (!(result.alpha >= renderer.options().select.min_alpha && length2 > 0 && std::isfinite(length2))) {
    return std::nullopt;
  }
  // The surface point is the origin of a reflected ray, traced or not.
  trace::Rays ray;
  surface::reflection_rays(one.camera, first_pixel(scene.device()), frame.raster.depth,
                           frame.raster.median_depth, frame.raster.normal, renderer.options().depth_ratio,
                           ray.origins, ray.directions);
  result.surface = vector(ray.origins);
  result.normal = normal / std::sqrt(length2);
  result.depth = number(frame.raster.depth);
  result.tint = number(frame.raster.tint);
  result.colour = vector(frame.colour);
  result.diffuse = vector(frame.raster.colour);
  if (!frame.traced.pixel.empty()) {
    result.specular = vector(frame.specular_image());
    result.mirrored = mirrored_of(frame.mirrored);
  }
  return result;
}

ProbeResult in_capture(ProbeResult result, const SceneNormalisation& normalisation) {
  const auto place = [&](const Vec3<float>& x) {
    return Vec3<float>(normalisation.in_capture(Vec3<double>(x)));
  };
  const auto length = [&](float l) { return static_cast<float>(l / normalisation.scale); };
  result.surface = place(result.surface);
  result.depth = length(result.depth);
  if (result.mirrored) {
    result.mirrored->distance = length(result.mirrored->distance);
    result.mirrored->end = place(result.mirrored->end);
  }
  return result;
}

}  // namespace traceflow::viz

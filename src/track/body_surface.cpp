#include "track/body_surface.h"

#include "math/rotation.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "track/bodies.h"

namespace traceflow {

Vec3<float> BodySurface::ray(int64_t pixel) const {
  const int64_t row = pixel / camera.width, column = pixel % camera.width;
  return camera.ray_in_world(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F);
}

BodySurface draw_bodies(const Camera<float>& camera, const Motion& motion, int64_t key,
                        const Surfels& surfels, const raster::Options& options) {
  constexpr float known = 0.7F;  // share of a pixel that a body must cover
  PosedSurfels posed;
  deform::forward(surfels, nullptr, motion.time[key], {}, 0, field::Precision::fp32, posed, nullptr);
  motion::forward(motion, surfels.body, motion.time[key], {}, posed, *motion::make_saved());
  for (int64_t i = 0; i < surfels.count(); ++i) {
    posed.opacity[i] = surfels.body[i] < 0 ? 0 : solid_opacity;
  }
  posed.tint.resize({surfels.count()});
  BodySurface surface{camera, {}, {}};
  raster::Output picture;
  for (int32_t body = 0; body < motion.bodies(); ++body) {
    // Uses the rasteriser's tint for the coverage by this body.
    for (int64_t i = 0; i < surfels.count(); ++i) posed.tint[i] = surfels.body[i] == body ? 1.0F : 0.0F;
    raster::forward(posed, camera, options, picture, nullptr);
    surface.points.resize(static_cast<size_t>(picture.alpha.size()));
    for (int64_t at = 0; at < picture.alpha.size(); ++at) {
      if (picture.tint[at] < known) continue;
      const Vec3<float> normal = load3<float>(&picture.normal[3 * at]);
      if (!(length(normal) > 0)) continue;
      surface.points[static_cast<size_t>(at)] = {body, camera.position + picture.depth[at] * surface.ray(at),
                                                 normalize(normal)};
    }
  }
  surface.alpha = picture.alpha;
  return surface;
}

std::vector<Mat3<double>> rotations_at(const Motion& motion, int64_t key) {
  std::vector<Mat3<double>> rotations;
  for (int64_t b = 0; b < motion.bodies(); ++b)
    rotations.push_back(rotation_from_quaternion(load4<double>(&motion.rotation(b, key, 0))));
  return rotations;
}

std::array<Vec3<double>, 2> pixel_by_point(const Camera<double>& camera, const Vec3<double>& in_camera) {
  const Mat3<double> axes = transpose(camera.camera_from_world);  // columns: the camera's axes in world axes
  const Vec3<double>& x = in_camera;
  return {camera.focal_x / x.z * (axes[0] - x.x / x.z * axes[2]),
          camera.focal_y / x.z * (axes[1] - x.y / x.z * axes[2])};
}

SurfacePoint at_rest(const SurfacePoint& point, const Motion& motion, int64_t key) {
  const Mat3<double> back =
      transpose(rotation_from_quaternion(load4<double>(&motion.rotation(point.body, key, 0))));
  const Vec3<double> centre = load3<double>(motion.centre.row(point.body));
  const Vec3<double> arm =
      Vec3<double>(point.position) - centre - load3<double>(&motion.shift(point.body, key, 0));
  return {point.body, Vec3<float>(centre + back * arm), Vec3<float>(back * Vec3<double>(point.normal))};
}

}  // namespace traceflow

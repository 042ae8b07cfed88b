#pragma once

#include <array>
#include <vector>

#include "ops/raster/raster.h"
#include "scene/motion.h"
#include "scene/surfels.h"

namespace traceflow {

// A point on the surface of a body, in world coordinates.
struct SurfacePoint {
  int32_t body = -1;
  Vec3<float> position{0}, normal{0};
};

// What the pixels of a camera show of the bodies alone, without occlusion by other surfels.
struct BodySurface {
  Camera<float> camera;
  Tensor<float> alpha;               // H×W
  std::vector<SurfacePoint> points;  // per pixel; body −1 if no body covers 0.7 of it

  // The ray through a pixel's centre.
  Vec3<float> ray(int64_t pixel) const;
};

// Renders the bodies at a key. options: of the rasteriser. On the CPU.
BodySurface draw_bodies(const Camera<float>& camera, const Motion& motion, int64_t key,
                        const Surfels& surfels, const raster::Options& options);

// The rotations of all bodies at a key.
std::vector<Mat3<double>> rotations_at(const Motion& motion, int64_t key);
// The derivatives of the pixel coordinates x and y by the position of a point in world axes. in_camera: the
// point in camera coordinates.
std::array<Vec3<double>, 2> pixel_by_point(const Camera<double>& camera, const Vec3<double>& in_camera);
// The same point of body `point.body` at rest.
SurfacePoint at_rest(const SurfacePoint& point, const Motion& motion, int64_t key);

}  // namespace traceflow

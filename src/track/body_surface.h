#pragma once

#include <array>
#include <vector>

#include "ops/raster/raster.h"
#include "scene/motion.h"
#include "scene/surfels.h"

namespace traceflow {

// A point of a body's surface, in world.
struct SurfacePoint {
  int32_t body = -1;
  Vec3<float> position{0}, normal{0};
};

// What the pixels of a camera show of the bodies alone: where their surfels are, however much of them shows.
struct BodySurface {
  Camera<float> camera;
  Tensor<float> alpha;               // H×W
  std::vector<SurfacePoint> points;  // of each pixel; body −1 where none covers 0.7 of it

  // The ray through a pixel's centre.
  Vec3<float> ray(int64_t pixel) const;
};

// The bodies as they stand at a key. options: how pictures are drawn. On the CPU.
BodySurface draw_bodies(const Camera<float>& camera, const Motion& motion, int64_t key,
                        const Surfels& surfels, const raster::Options& options);

// The rotations of all bodies at a key.
std::vector<Mat3<double>> rotations_at(const Motion& motion, int64_t key);
// How the pixel that shows a point moves with it, in world: ∂x and ∂y. in_camera: the point, before the
// camera.
std::array<Vec3<double>, 2> pixel_by_point(const Camera<double>& camera, const Vec3<double>& in_camera);
// The same point of body `point.body` at rest.
SurfacePoint at_rest(const SurfacePoint& point, const Motion& motion, int64_t key);

}  // namespace traceflow

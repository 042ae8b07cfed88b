#include "eval/surfel_density.h"

#include "base/error.h"

namespace traceflow::eval {

int64_t surfels_in_mask(const Frame& frame, const Tensor<uint8_t>& mask) {
  constexpr float behind = 1.02F;
  const Camera<float>& camera = frame.camera;
  require(mask.shape() == Shape{camera.height, camera.width}, "the mask has the frame's size");
  const Tensor<float> position = frame.main.position.on(Device::cpu);
  const Tensor<float> depth = frame.raster.depth.on(Device::cpu);
  int64_t count = 0;
  for (int64_t i = 0; i < frame.main.count(); ++i) {
    const Vec3<float> point = load3<float>(position.row(i));
    if (!camera.sees(point)) continue;
    const Vec3<float> centre = camera.point_in_camera(point);
    const Vec2<float> at = camera.project(centre);
    const auto x = static_cast<int64_t>(at.x), y = static_cast<int64_t>(at.y);
    if (mask(y, x) != 0 && centre.z <= behind * depth(y, x)) ++count;
  }
  return count;
}

}  // namespace traceflow::eval

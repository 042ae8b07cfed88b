#include "render/visibility.h"

#include <cmath>

#include "base/parallel.h"

namespace traceflow {

namespace {

// A disk of full opacity ends at √(2 ln 255) = 3.33 standard deviations; the field may also widen it, by half
// as much again.
constexpr float disk_radius = 5.0F;

// The view's pyramid: inward unit normals of its four sides, in camera axes, through the origin.
struct Pyramid {
  Vec3<float> left, right, top, bottom;

  explicit Pyramid(const Camera<float>& c) {
    const Vec3<float> low = c.ray_in_camera(0, 0);
    const Vec3<float> high = c.ray_in_camera(static_cast<float>(c.width), static_cast<float>(c.height));
    left = normalize(Vec3<float>(1, 0, -low.x));
    right = normalize(Vec3<float>(-1, 0, high.x));
    top = normalize(Vec3<float>(0, 1, -low.y));
    bottom = normalize(Vec3<float>(0, -1, high.y));
  }
  bool meets(const Vec3<float>& centre, float radius, float near_plane) const {
    return centre.z + radius > near_plane && dot(left, centre) > -radius && dot(right, centre) > -radius &&
           dot(top, centre) > -radius && dot(bottom, centre) > -radius;
  }
};

}  // namespace

Tensor<int32_t> surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane,
                                float reach) {
  const Pyramid pyramid(camera);
  const int64_t count = surfels.count();
  std::vector<uint8_t> in_view(static_cast<size_t>(count));
  parallel_for("render: view culling", count, [&](int64_t i) {
    const Vec3<float> centre = camera.point_in_camera(load3<float>(surfels.position.row(i)));
    const float scale = std::exp(std::max(surfels.log_scale(i, 0), surfels.log_scale(i, 1)));
    const float radius = reach + disk_radius * scale;
    in_view[static_cast<size_t>(i)] =
        std::isfinite(radius) && pyramid.meets(centre, radius, near_plane) ? 1 : 0;
  });
  std::vector<int32_t> indices;
  indices.reserve(static_cast<size_t>(count));
  for (int64_t i = 0; i < count; ++i) {
    if (in_view[static_cast<size_t>(i)]) indices.push_back(static_cast<int32_t>(i));
  }
  return tensor_of(indices);
}

}  // namespace traceflow

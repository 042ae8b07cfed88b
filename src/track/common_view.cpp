#include "track/common_view.h"

#include <algorithm>
#include <cmath>

namespace traceflow {

namespace {

int64_t views_that_see(const std::vector<View>& views, const Vec3<float>& point) {
  return std::count_if(views.begin(), views.end(), [&](const View& view) { return view.camera.sees(point); });
}

Vec3<float> point_before_some_camera(const std::vector<View>& views, float extent, Random& random) {
  constexpr double nearest = 0.2, farthest = 10;
  const auto& camera = views[static_cast<size_t>(random.below(static_cast<int64_t>(views.size())))].camera;
  const auto x = static_cast<float>(random.uniform(0, camera.width));
  const auto y = static_cast<float>(random.uniform(0, camera.height));
  const double depth = extent * std::exp(random.uniform(std::log(nearest), std::log(farthest)));
  return camera.position +
         transpose(camera.camera_from_world) * (static_cast<float>(depth) * camera.ray_in_camera(x, y));
}

}  // namespace

Tensor<float> points_in_common_view(const std::vector<View>& views, float extent, int64_t count,
                                    Random& random) {
  constexpr int64_t probes = 2000, draws_per_point = 200;
  if (views.empty()) return Tensor<float>({0, 3});
  int64_t best = 0;
  for (int64_t i = 0; i < probes; ++i)
    best = std::max(best, views_that_see(views, point_before_some_camera(views, extent, random)));
  Tensor<float> points({count, 3});
  int64_t kept = 0;
  for (int64_t draw = 0; draw < draws_per_point * count && kept < count; ++draw) {
    const Vec3<float> point = point_before_some_camera(views, extent, random);
    if (2 * views_that_see(views, point) >= best) store3(points.row(kept++), point);
  }
  points.resize({kept, 3});
  return points;
}

}  // namespace traceflow

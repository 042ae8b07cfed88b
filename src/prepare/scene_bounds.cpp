#include "prepare/scene_bounds.h"

#include <algorithm>
#include <cmath>

#include "base/robust.h"

namespace traceflow::prepare {

namespace {

// The quantile of the values at this share; reorders them.
double quantile(std::vector<double>& values, double share) {
  return ranked(values, static_cast<size_t>(std::lround(share * static_cast<double>(values.size() - 1))));
}

std::vector<double> depths_seen(const std::vector<Vec3<double>>& points,
                                const std::vector<Camera<double>>& cameras) {
  std::vector<double> depths;
  for_each_sampled_pair(points, cameras, [&](const Vec3<double>& point, const Camera<double>& camera) {
    if (camera.sees(point)) depths.push_back(camera.point_in_camera(point).z);
  });
  return depths;
}

}  // namespace

SceneBounds scene_bounds(const std::vector<Vec3<double>>& points,
                         const std::vector<Camera<double>>& cameras) {
  constexpr double outer = 0.025, rare = 0.0005, more = 1.2;
  Vec3<double> low(cameras.front().position), high(low);
  for (const Camera<double>& camera : cameras) {
    low = min(low, camera.position);
    high = max(high, camera.position);
  }
  for (int axis = 0; axis < 3 && !points.empty(); ++axis) {
    std::vector<double> values;
    values.reserve(points.size());
    for (const Vec3<double>& point : points) values.push_back(point[axis]);
    low[axis] = std::min(low[axis], quantile(values, outer));
    high[axis] = std::max(high[axis], quantile(values, 1 - outer));
  }
  SceneBounds bounds;
  bounds.normalisation.centre = 0.5 * (low + high);
  const double diagonal = length(high - low);
  bounds.normalisation.scale = diagonal > 0 ? 1 / diagonal : 1;
  std::vector<double> depths = depths_seen(points, cameras);
  if (!depths.empty()) {
    bounds.near_plane = quantile(depths, rare) / more * bounds.normalisation.scale;
    bounds.far_plane = quantile(depths, 1 - rare) * more * bounds.normalisation.scale;
  }
  return bounds;
}

}  // namespace traceflow::prepare

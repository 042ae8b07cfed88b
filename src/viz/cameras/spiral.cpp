#include "viz/cameras/spiral.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/robust.h"
#include "viz/cameras/look_at.h"

namespace traceflow::viz {

namespace {

using V = Vec3<double>;

constexpr double turns = 2;
constexpr double depth_turns = 1;
constexpr double least_share = 1.0 / 50;

// The 90th percentile of the cameras' distances from the mean along an axis.
double extent_along(const std::vector<Camera<float>>& cameras, const V& centroid, const V& axis) {
  std::vector<double> distances;
  distances.reserve(cameras.size());
  for (const Camera<float>& c : cameras) distances.push_back(std::abs(dot(V(c.position) - centroid, axis)));
  return ranked(distances, (distances.size() - 1) * 9 / 10);
}

}  // namespace

std::vector<Shot> spiral_around_cameras(const std::vector<Camera<float>>& cameras, int frames) {
  require(!cameras.empty(), "a spiral has cameras to go by");
  const Aim aim = aim_of(cameras);
  const V centroid = aim.centroid, z = aim.forward, up = aim.up;
  const V x = unit(cross(z, up), perpendicular(z)), y = cross(z, x);
  const double distance = length(aim.target - centroid);
  const double wide = std::max(extent_along(cameras, centroid, x), least_share * distance);
  const double high = std::max(extent_along(cameras, centroid, y), least_share * distance);
  // Never moves through the target.
  const double deep = std::min(extent_along(cameras, centroid, z), distance / 2);

  std::vector<Shot> shots;
  for (int i = 0; i < frames; ++i) {
    const double angle = 2 * std::numbers::pi * i / frames;
    const V from = centroid + wide * std::cos(turns * angle) * x - high * std::sin(turns * angle) * y -
                   deep * std::sin(depth_turns * angle) * z;
    shots.push_back({fmt::format("{:05}", i), std::nullopt,
                     looking(cameras.front(), from, unit(aim.target - from, z), up)});
  }
  return shots;
}

}  // namespace traceflow::viz

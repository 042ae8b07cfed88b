#include "viz/cameras/orbit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/robust.h"
#include "viz/cameras/look_at.h"

namespace traceflow::viz {

namespace {

using V = Vec3<double>;
constexpr double pi = std::numbers::pi;

// Cameras on a circle, or an arc of it, that look at the target.
struct Circle {
  V target{0}, up{0, -1, 0};
  V start{0, 0, -1};  // unit, perpendicular to up: the direction of angle 0
  double radius = 1, height = 0;
  double swing = pi;  // largest angle to each side; pi is a full circle
};

Circle circle_from(const std::vector<Camera<float>>& cameras) {
  const Aim aim = aim_of(cameras);
  Circle circle;
  circle.up = aim.up;
  circle.target = aim.target;

  double radius = 0, height = 0;
  for (const Camera<float>& c : cameras) {
    const V offset = V(c.position) - circle.target;
    const double above = dot(offset, circle.up);
    height += above / static_cast<double>(cameras.size());
    radius += length(offset - above * circle.up) / static_cast<double>(cameras.size());
  }
  circle.radius = std::max(radius, 1e-6);
  circle.height = height;
  const V mean_offset = aim.centroid - circle.target;
  circle.start = unit(mean_offset - dot(mean_offset, circle.up) * circle.up, perpendicular(circle.up));

  const V side = cross(circle.up, circle.start);
  double left = 0, right = 0;
  for (const Camera<float>& c : cameras) {
    const V offset = V(c.position) - circle.target;
    const double angle = std::atan2(dot(offset, side), dot(offset, circle.start));
    left = std::min(left, angle);
    right = std::max(right, angle);
  }
  circle.swing = right - left > 4 * pi / 3 ? pi : std::max((right - left) / 2, pi / 12);
  return circle;
}

Camera<float> look(Camera<float> camera, const Circle& circle, double angle) {
  const V side = cross(circle.up, circle.start);
  const V offset =
      circle.radius * (std::cos(angle) * circle.start + std::sin(angle) * side) + circle.height * circle.up;
  return looking(camera, circle.target + offset, unit(-offset, circle.start), circle.up);
}

std::vector<Shot> path(const Camera<float>& like, const Circle& circle, int frames) {
  std::vector<Shot> shots;
  for (int i = 0; i < frames; ++i) {
    const double turn = 2 * pi * i / frames;
    const double angle = circle.swing >= pi ? turn : circle.swing * std::sin(turn);
    shots.push_back({fmt::format("{:05}", i), std::nullopt, look(like, circle, angle)});
  }
  return shots;
}

}  // namespace

std::vector<Shot> orbit_around_cameras(const std::vector<Camera<float>>& cameras, int frames) {
  require(!cameras.empty(), "an orbit has cameras to go by");
  return path(cameras.front(), circle_from(cameras), frames);
}

std::vector<Shot> orbit_around_points(const Tensor<float>& points, int width, int height, int frames) {
  Circle circle;
  circle.target = median_point(points);
  std::vector<double> distances;
  for (int64_t i = 0; i < (points.empty() ? 0 : points.dim(0)); ++i) {
    const double d = length(load3<double>(points.row(i)) - circle.target);
    if (std::isfinite(d)) distances.push_back(d);
  }
  double extent = distances.empty() ? 0 : ranked(distances, distances.size() * 9 / 10);
  if (extent == 0) extent = 1;
  circle.radius = 2.5 * extent;
  circle.height = 0.75 * extent;
  Camera<float> like;
  like.width = width;
  like.height = height;
  like.focal_x = like.focal_y = static_cast<float>(height / 2.0 / std::tan(pi / 8));
  like.centre_x = static_cast<float>(width) / 2;
  like.centre_y = static_cast<float>(height) / 2;
  return path(like, circle, frames);
}

}  // namespace traceflow::viz

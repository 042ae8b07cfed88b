#include "track/point_distance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace traceflow {

namespace {

constexpr double inner = 0.4;  // radii from the outline
constexpr double near = 0.6;   // radii from the rendered surface
constexpr size_t least_points = 30;
constexpr double least_errors = 3;

// Whether the pixels `away` pixels away in all eight directions show the same body.
bool is_inside(const BodySurface& surface, int64_t row, int64_t column, int64_t away) {
  const int64_t height = surface.camera.height, width = surface.camera.width;
  const int32_t body = surface.points[static_cast<size_t>(row * width + column)].body;
  for (int64_t down = -1; down <= 1; ++down) {
    for (int64_t right = -1; right <= 1; ++right) {
      const int64_t r = row + down * away, c = column + right * away;
      if (r < 0 || c < 0 || r >= height || c >= width) return false;
      if (surface.points[static_cast<size_t>(r * width + c)].body != body) return false;
    }
  }
  return true;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<int64_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::vector<double> distance_by_points(const BodySurface& surface, const Tensor<float>& points,
                                       int64_t bodies) {
  const Camera<double> camera = convert<double>(surface.camera);
  std::vector<double> radius(static_cast<size_t>(bodies));  // pixels
  for (const SurfacePoint& point : surface.points) {
    if (point.body >= 0) radius[static_cast<size_t>(point.body)] += 1;
  }
  for (double& r : radius) r = std::sqrt(r / std::numbers::pi);

  std::vector<std::vector<double>> found(static_cast<size_t>(bodies));
  const int64_t count = points.empty() ? 0 : points.dim(0);
  for (int64_t i = 0; i < count; ++i) {
    const Vec3<double> in_camera = camera.point_in_camera(load3<double>(points.row(i)));
    if (!(in_camera.z > 0)) continue;
    const Vec2<double> at = camera.project(in_camera);
    const auto column = static_cast<int64_t>(std::floor(at.x)), row = static_cast<int64_t>(std::floor(at.y));
    if (column < 0 || row < 0 || column >= camera.width || row >= camera.height) continue;
    const SurfacePoint& shown = surface.points[static_cast<size_t>(row * camera.width + column)];
    if (shown.body < 0) continue;
    const auto body = static_cast<size_t>(shown.body);
    const double drawn = camera.point_in_camera(Vec3<double>(shown.position)).z;
    const bool is_front = std::abs(in_camera.z - drawn) < near * radius[body] * drawn / camera.focal_x;
    const auto away = std::max<int64_t>(1, std::lround(inner * radius[body]));
    if (is_front && is_inside(surface, row, column, away)) found[body].push_back(in_camera.z / drawn);
  }

  std::vector<double> ratios(static_cast<size_t>(bodies), 1);
  for (size_t body = 0; body < ratios.size(); ++body) {
    std::vector<double>& of_body = found[body];
    if (of_body.size() < least_points) continue;
    const double ratio = median(of_body);
    for (double& value : of_body) value = std::abs(value - ratio);
    // The standard error of a median. A normal distribution's deviation is 1.48 times its median absolute
    // deviation.
    const double error = 1.25 * 1.48 * median(of_body) / std::sqrt(static_cast<double>(of_body.size()));
    if (std::abs(ratio - 1) > least_errors * error) ratios[body] = ratio;
  }
  return ratios;
}

}  // namespace traceflow

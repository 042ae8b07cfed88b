#include "prepare/depth_points.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "base/parallel.h"

namespace traceflow::prepare {

namespace {

constexpr double depth_tolerance = 0.03;
const double least_cos = std::cos(glm::radians(1.0));

bool is_depth(double z) { return z > 0 && std::isfinite(z); }

Vec3<double> back_projected(const Camera<double>& camera, const Vec2<double>& at, double z) {
  return camera.position + z * camera.ray_in_world(at.x, at.y);
}

// The depth at a position between four pixels' centres. Interpolates 1/z, which is linear over the image of a
// plane. Nothing at the border, and where the four are not of one surface.
std::optional<double> depth_at(const Tensor<float>& depth, const Vec2<double>& at) {
  constexpr double one_surface = 1.05;
  const double x = at.x - 0.5, y = at.y - 0.5;
  const auto column = static_cast<int64_t>(std::floor(x)), row = static_cast<int64_t>(std::floor(y));
  if (column < 0 || row < 0 || column + 1 >= depth.dim(1) || row + 1 >= depth.dim(0)) return std::nullopt;
  const double fx = x - static_cast<double>(column), fy = y - static_cast<double>(row);
  double inverse = 0, nearest = INFINITY, farthest = 0;
  for (const int64_t dy : {0, 1}) {
    for (const int64_t dx : {0, 1}) {
      const double z = depth(row + dy, column + dx);
      if (!is_depth(z)) return std::nullopt;
      inverse += (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy) / z;
      nearest = std::min(nearest, z);
      farthest = std::max(farthest, z);
    }
  }
  if (farthest > one_surface * nearest) return std::nullopt;
  return 1 / inverse;
}

// The views 1, 2, 4, … before and after.
std::vector<int64_t> others_of(int64_t view, int64_t count) {
  std::vector<int64_t> others;
  for (int64_t step = 1; step < count; step *= 2) {
    if (view - step >= 0) others.push_back(view - step);
    if (view + step < count) others.push_back(view + step);
  }
  return others;
}

std::optional<DepthPoint> agreed(const std::vector<DepthView>& views, int64_t view, const Vec2<double>& at,
                                 double z, double largest_error) {
  constexpr int fewest_others = 2;
  const Camera<double>& first = views[static_cast<size_t>(view)].camera;
  const Vec3<double> point = back_projected(first, at, z), ray = normalize(point - first.position);
  DepthPoint result{point, 0, {{view, at}}};
  int agree = 0, see_through = 0;
  double smallest_cos = 1;
  for (const int64_t other : others_of(view, static_cast<int64_t>(views.size()))) {
    const DepthView& there = views[static_cast<size_t>(other)];
    if (!there.camera.sees(point)) continue;
    const Vec3<double> in_camera = there.camera.point_in_camera(point);
    const Vec2<double> place = there.camera.project(in_camera);
    const std::optional<double> depth = depth_at(there.depth, place);
    if (!depth) continue;
    const double farther = *depth / in_camera.z - 1;
    if (farther > depth_tolerance) ++see_through;
    if (std::abs(farther) > depth_tolerance) continue;
    const Vec3<double> back = back_projected(there.camera, place, *depth),
                       back_in_first = first.point_in_camera(back);
    if (!(back_in_first.z > 0)) continue;
    const double error = length(first.project(back_in_first) - at);
    if (!(error <= largest_error)) continue;
    ++agree;
    result.position += back;
    result.error += error;
    result.seen.push_back({other, place});
    smallest_cos = std::min(smallest_cos, dot(ray, normalize(point - there.camera.position)));
  }
  if (agree < fewest_others || agree <= see_through || smallest_cos > least_cos) return std::nullopt;
  result.position /= agree + 1;
  result.error /= agree;
  return result;
}

double fraction(double value) { return value - std::floor(value); }

}  // namespace

AgreeingPoints agreeing_points(const std::vector<DepthView>& views, double largest_error, int64_t most,
                               const Work& work) {
  // So many more than wanted, since not all will agree.
  constexpr double more = 4;
  const auto count = static_cast<int64_t>(views.size());
  std::vector<AgreeingPoints> found(views.size());
  std::atomic<int64_t> done = 0;
  parallel_for(
      "prepare: points of depths", count,
      [&](int64_t i) {
        work.check();
        const DepthView& view = views[static_cast<size_t>(i)];
        AgreeingPoints& mine = found[static_cast<size_t>(i)];
        const double step = std::max(1.0, std::sqrt(static_cast<double>(view.depth.size() * count) /
                                                    (more * static_cast<double>(most))));
        // The views' grids are shifted against each other, along both axes by irrational steps, so that the
        // views of a slow camera do not all show the same points.
        const double shift_x = fraction(0.7548776662 * static_cast<double>(i)),
                     shift_y = fraction(0.5698402910 * static_cast<double>(i));
        for (int64_t k = 0;; ++k) {
          const auto y = static_cast<int64_t>((static_cast<double>(k) + shift_y) * step);
          if (y >= view.depth.dim(0)) break;
          for (int64_t l = 0;; ++l) {
            const auto x = static_cast<int64_t>((static_cast<double>(l) + shift_x) * step);
            if (x >= view.depth.dim(1)) break;
            const double z = view.depth(y, x);
            if (!is_depth(z)) continue;
            ++mine.sampled;
            const Vec2<double> at(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
            if (auto point = agreed(views, i, at, z, largest_error)) mine.points.push_back(std::move(*point));
          }
        }
        work.tell(++done, count);
      },
      1);
  AgreeingPoints all;
  for (AgreeingPoints& part : found) {
    all.sampled += part.sampled;
    std::ranges::move(part.points, std::back_inserter(all.points));
  }
  all.agreeing = static_cast<int64_t>(all.points.size());
  if (all.agreeing <= most) return all;
  for (int64_t i = 0; i < most; ++i)
    std::swap(all.points[static_cast<size_t>(i)], all.points[static_cast<size_t>(i * all.agreeing / most)]);
  all.points.resize(static_cast<size_t>(most));
  return all;
}

}  // namespace traceflow::prepare

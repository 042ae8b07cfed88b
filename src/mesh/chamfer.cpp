#include "mesh/chamfer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "math/types.h"
#include "scene/neighbours.h"

namespace traceflow::mesh {

namespace {

using V = Vec3<double>;

// The nearest samples whose triangles are tried.
constexpr int tried = 8;

V corner_position(const TriangleMesh& mesh, int64_t triangle, int64_t k) {
  return load3<double>(mesh.vertices.row(mesh.triangles(triangle, k)));
}

double distance_to_segment(const V& p, const V& a, const V& b) {
  const V along = b - a;
  const double length2 = dot(along, along);
  const double t = length2 > 0 ? std::clamp(dot(p - a, along) / length2, 0.0, 1.0) : 0;
  return length(p - (a + t * along));
}

double distance_to_triangle(const V& p, const V& a, const V& b, const V& c) {
  const V normal = cross(b - a, c - a);
  const bool is_above = dot(cross(b - a, p - a), normal) >= 0 && dot(cross(c - b, p - b), normal) >= 0 &&
                        dot(cross(a - c, p - c), normal) >= 0;
  const double area = length(normal);
  if (is_above && area > 0) return std::fabs(dot(p - a, normal)) / area;
  return std::min({distance_to_segment(p, a, b), distance_to_segment(p, b, c), distance_to_segment(p, c, a)});
}

// The nearest of a surface's samples to a point, and the distance.
struct Nearest {
  int64_t sample = 0;
  double distance = std::numeric_limits<double>::infinity();
};

std::vector<Nearest> nearest_on(const SurfaceSamples& surface, const Tensor<float>& points) {
  const bool has_triangles = !surface.corners.empty();
  const Neighbours near = nearest_of(surface.points, points, has_triangles ? tried : 1);
  std::vector<Nearest> result(static_cast<size_t>(points.dim(0)));
  parallel_for("mesh: distances", points.dim(0), [&](int64_t i) {
    const V point = load3<double>(points.row(i));
    Nearest& best = result[static_cast<size_t>(i)];
    for (int64_t k = 0; k < near.index.dim(1) && near.index(i, k) >= 0; ++k) {
      const int64_t sample = near.index(i, k);
      const float* corners = has_triangles ? surface.corners.row(sample) : nullptr;
      const double distance =
          has_triangles ? distance_to_triangle(point, load3<double>(corners), load3<double>(corners + 3),
                                               load3<double>(corners + 6))
                        : length(point - load3<double>(surface.points.row(sample)));
      if (distance < best.distance) best = {sample, distance};
    }
  });
  return result;
}

double mean_distance(const std::vector<Nearest>& nearest) {
  const auto count = static_cast<int64_t>(nearest.size());
  return ordered_sum<double>("mesh: mean distance", count,
                             [&](int64_t i) { return nearest[static_cast<size_t>(i)].distance; }) /
         static_cast<double>(count);
}

}  // namespace

SurfaceSamples sample_surface(const TriangleMesh& mesh, int64_t count, uint64_t seed) {
  const int64_t triangles = mesh.triangle_count();
  double area = 0;
  std::vector<double> up_to;  // the area of a triangle and all before it
  up_to.reserve(static_cast<size_t>(triangles));
  for (int64_t t = 0; t < triangles; ++t) {
    const V a = corner_position(mesh, t, 0);
    area += length(cross(corner_position(mesh, t, 1) - a, corner_position(mesh, t, 2) - a)) / 2;
    up_to.push_back(area);
  }
  require(area > 0 && std::isfinite(area), "a sampled mesh has an area", std::to_string(area));

  Random random(seed);
  SurfaceSamples samples{Tensor<float>(Shape{count, 3}), Tensor<float>(Shape{count, 3}),
                         Tensor<float>(Shape{count, 3, 3})};
  for (int64_t i = 0; i < count; ++i) {
    // One in each of `count` equal parts of the area.
    const double place = area * (static_cast<double>(i) + random.uniform()) / static_cast<double>(count);
    const auto found = std::ranges::upper_bound(up_to, place);
    const int64_t t = std::min<int64_t>(found - up_to.begin(), triangles - 1);
    const double root = std::sqrt(random.uniform()), part = random.uniform();
    const std::array<double, 3> share = {1 - root, root * (1 - part), root * part};
    V point(0), normal(0);
    for (int64_t k = 0; k < 3; ++k) {
      const V corner = corner_position(mesh, t, k);
      point += share[static_cast<size_t>(k)] * corner;
      normal += share[static_cast<size_t>(k)] * load3<double>(mesh.normals.row(mesh.triangles(t, k)));
      store3(samples.corners.row(i) + 3 * k, corner);
    }
    const double size = length(normal);
    store3(samples.points.row(i), point);
    store3(samples.normals.row(i), size > 0 ? normal / size : normal);
  }
  return samples;
}

SurfaceError compare_surfaces(const SurfaceSamples& found, const SurfaceSamples& truth) {
  require(found.count() > 0 && truth.count() > 0, "surfaces that are compared have points");
  const std::vector<Nearest> to_truth = nearest_on(truth, found.points);
  SurfaceError error;
  error.accuracy = mean_distance(to_truth);
  error.completeness = mean_distance(nearest_on(found, truth.points));
  const auto angle = [&](int64_t i) {
    const V of_found = load3<double>(found.normals.row(i));
    const V of_truth = load3<double>(truth.normals.row(to_truth[static_cast<size_t>(i)].sample));
    return std::atan2(length(cross(of_found, of_truth)), dot(of_found, of_truth));
  };
  error.normal_error_deg = ordered_sum<double>("mesh: normal error", found.count(), angle) * 180 /
                           std::numbers::pi / static_cast<double>(found.count());
  return error;
}

}  // namespace traceflow::mesh

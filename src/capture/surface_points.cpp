#include "capture/surface_points.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "math/symmetric_eigen.h"
#include "scene/neighbours.h"

namespace traceflow {

namespace {

constexpr int neighbour_count = 12;  // points that a plane is fitted to
constexpr int64_t max_points = 20000;

Tensor<float> every_nth(const Tensor<float>& points) {
  const int64_t step = (points.dim(0) + max_points - 1) / max_points;
  if (step <= 1) return points;
  Tensor<float> kept({(points.dim(0) + step - 1) / step, 3});
  for (int64_t i = 0; i < kept.dim(0); ++i) std::copy_n(points.row(i * step), 3, kept.row(i));
  return kept;
}

// Unit normals with arbitrary sign; zero if the neighbours do not lie in a plane.
Tensor<float> point_normals(const Tensor<float>& points) {
  constexpr double flat = 0.1;  // limit of thickness² / width²
  const Neighbours near = nearest_neighbours(points, neighbour_count);
  Tensor<float> normals(points.shape());
  parallel_for("capture: planes through points", points.dim(0), [&](int64_t i) {
    Vec3<double> mean(0);
    Mat3<double> covariance(0);
    for (const bool second : {false, true}) {
      for (int k = -1; k < neighbour_count; ++k) {
        const int64_t j = k < 0 ? i : std::max(0, near.index(i, k));
        const Vec3<double> x = load3<double>(points.row(j));
        if (!second) mean += x / static_cast<double>(neighbour_count + 1);
        if (second) covariance += outerProduct(x - mean, x - mean);
      }
    }
    const auto eigen = symmetric_eigen(covariance);
    if (eigen.values[1] > 0 && eigen.values[0] < flat * eigen.values[1])
      store3(normals.row(i), eigen.vectors[0]);
  });
  return normals;
}

// The nearest depth in each cell of the image. Cells are large enough to hold a few points each. A point well
// behind the nearest depth counts as hidden.
class DepthCells {
 public:
  DepthCells(const Camera<float>& camera, const Tensor<float>& points) : camera_(camera) {
    constexpr double points_in_cell = 24;
    std::vector<Vec3<float>> seen;  // pixel, depth
    for (int64_t i = 0; i < points.dim(0); ++i) {
      const Vec3<float> x = camera.point_in_camera(load3<float>(points.row(i)));
      Vec2<float> at;
      if (sees(x, at)) seen.emplace_back(at, x.z);
    }
    const double area = static_cast<double>(camera.width) * camera.height;
    side_ = std::max(8.0F, static_cast<float>(std::sqrt(area * points_in_cell /
                                                        std::max(1.0, static_cast<double>(seen.size())))));
    columns_ = static_cast<size_t>(static_cast<float>(camera.width) / side_) + 1;
    const size_t rows = static_cast<size_t>(static_cast<float>(camera.height) / side_) + 1;
    nearest_.assign(columns_ * rows, std::numeric_limits<float>::infinity());
    for (const Vec3<float>& s : seen) {
      float& depth = nearest_[cell({s.x, s.y})];
      depth = std::min(depth, s.z);
    }
  }
  bool sees(const Vec3<float>& x, Vec2<float>& at) const {
    if (!(x.z > 0)) return false;
    at = camera_.project(x);
    return at.x >= 0 && at.y >= 0 && at.x < static_cast<float>(camera_.width) &&
           at.y < static_cast<float>(camera_.height);
  }
  bool hides(const Vec2<float>& at, float depth) const { return depth > 1.05F * nearest_[cell(at)]; }

 private:
  size_t cell(const Vec2<float>& at) const {
    return static_cast<size_t>(at.y / side_) * columns_ + static_cast<size_t>(at.x / side_);
  }
  const Camera<float>& camera_;
  float side_ = 8;
  size_t columns_ = 1;
  std::vector<float> nearest_;
};

}  // namespace

SurfacePoints::SurfacePoints(const Tensor<float>& points) {
  if (points.empty() || points.dim(0) <= neighbour_count) return;
  points_ = every_nth(points);
  normals_ = point_normals(points_);
}

void SurfacePoints::for_each_visible(
    const Camera<float>& camera,
    const std::function<void(const Vec2<float>& pixel, float depth, const Vec3<double>& normal)>& f) const {
  if (empty()) return;
  const DepthCells cells(camera, points_);
  for (int64_t i = 0; i < points_.dim(0); ++i) {
    const Vec3<float> x = camera.point_in_camera(load3<float>(points_.row(i)));
    Vec2<float> at;
    if (!cells.sees(x, at) || cells.hides(at, x.z)) continue;
    const Vec3<double> normal(camera.camera_from_world * load3<float>(normals_.row(i)));
    if (normal != Vec3<double>(0)) f(at, x.z, dot(normal, Vec3<double>(x)) > 0 ? -normal : normal);
  }
}

}  // namespace traceflow

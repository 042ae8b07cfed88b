#include "capture/prior_axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "math/symmetric_eigen.h"
#include "scene/neighbours.h"

namespace traceflow {

namespace {

constexpr std::array named_axes = {PriorAxes::opengl, PriorAxes::opencv, PriorAxes::stable_normal};
constexpr double clear = 0.3;        // a correlation that decides
constexpr int64_t enough = 100;      // samples that decide
constexpr int neighbour_count = 12;  // points that a plane is laid through
constexpr int64_t max_points = 20000;

Tensor<float> every_nth(const Tensor<float>& points) {
  const int64_t step = (points.dim(0) + max_points - 1) / max_points;
  if (step <= 1) return points;
  Tensor<float> kept({(points.dim(0) + step - 1) / step, 3});
  for (int64_t i = 0; i < kept.dim(0); ++i) std::copy_n(points.row(i * step), 3, kept.row(i));
  return kept;
}

// Unit normals of either sign; zero where the neighbours do not lie in a plane.
Tensor<float> point_normals(const Tensor<float>& points) {
  constexpr double flat = 0.1;  // thickness² against width²
  const Neighbours near = nearest_neighbours(points, neighbour_count);
  Tensor<float> normals(points.shape());
  parallel_for("prior axes: planes", points.dim(0), [&](int64_t i) {
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

struct Sums {
  Vec3<double> product{0}, prior2{0}, truth2{0};
  int64_t samples = 0;

  void add(const Vec3<double>& prior, const Vec3<double>& truth) {
    product += prior * truth;
    prior2 += prior * prior;
    truth2 += truth * truth;
    ++samples;
  }
};

// The nearest depth in each square of the image, of a size that a few points fall into each: what lies well
// behind it is taken for hidden.
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

void add_view(const PriorView& view, const Tensor<float>& points, const Tensor<float>& normals, Sums& sums) {
  const DepthCells cells(view.camera, points);
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vec3<float> x = view.camera.point_in_camera(load3<float>(points.row(i)));
    Vec2<float> at;
    if (!cells.sees(x, at) || cells.hides(at, x.z)) continue;
    const Vec3<double> prior =
        load3<double>(&view.normal(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x), 0));
    Vec3<double> truth(view.camera.camera_from_world * load3<float>(normals.row(i)));
    if (prior == Vec3<double>(0) || truth == Vec3<double>(0)) continue;
    if (dot(truth, Vec3<double>(x)) > 0) truth = -truth;
    sums.add(prior, truth);
  }
}

std::string signs_text(const Vec3<double>& correlation) {
  std::string text;
  for (int axis = 0; axis < 3; ++axis) {
    const double c = correlation[axis];
    text += std::string(axis == 0 ? "" : " ") + "xyz"[axis] + (std::abs(c) < clear ? '?' : c > 0 ? '+' : '-');
  }
  return text;
}

}  // namespace

Vec3<double> prior_axis_signs(PriorAxes axes) {
  switch (axes) {
    case PriorAxes::opencv:
      return {1, 1, 1};
    case PriorAxes::stable_normal:
      return {-1, -1, -1};
    default:
      return {1, -1, -1};
  }
}

std::string prior_axes_name(PriorAxes axes) {
  return std::string(enum_names(axes)[static_cast<size_t>(axes)]);
}

bool agrees(PriorAxes axes, const AxisEvidence& evidence) {
  const Vec3<double> signs = prior_axis_signs(axes);
  for (int axis = 0; axis < 3; ++axis) {
    const double correlation = evidence.correlation[axis];
    if (std::abs(correlation) >= clear && correlation * signs[axis] < 0) return false;
  }
  return true;
}

AxisEvidence measure_prior_axes(const Tensor<float>& points, const std::vector<PriorView>& views) {
  Sums sums;
  if (!points.empty() && points.dim(0) > neighbour_count) {
    const Tensor<float> some = every_nth(points);
    const Tensor<float> normals = point_normals(some);
    for (const PriorView& view : views) add_view(view, some, normals, sums);
  }
  if (sums.samples < enough) {
    sums = {};
    for (const PriorView& view : views) {
      for (int64_t i = 0; i < view.normal.size(); i += 3) {
        const Vec3<double> prior = load3<double>(&view.normal[i]);
        if (prior != Vec3<double>(0)) sums.add(prior, {0, 0, -1});
      }
    }
  }
  AxisEvidence evidence{Vec3<double>(0), sums.samples};
  if (sums.samples < enough) return evidence;
  for (int axis = 0; axis < 3; ++axis) {
    const double scale = std::sqrt(sums.prior2[axis] * sums.truth2[axis]);
    if (scale > 0) evidence.correlation[axis] = sums.product[axis] / scale;
  }
  return evidence;
}

AxisChoice choose_prior_axes(PriorAxes asked, const AxisEvidence& evidence) {
  const PriorAxes preferred = asked == PriorAxes::automatic ? PriorAxes::opengl : asked;
  if (agrees(preferred, evidence)) return {preferred, ""};
  const auto better = std::find_if(named_axes.begin(), named_axes.end(),
                                   [&](PriorAxes axes) { return agrees(axes, evidence); });
  const std::string disagrees = "normal priors: the axes " + prior_axes_name(preferred) +
                                " disagree with the geometry, which reads " +
                                signs_text(evidence.correlation) + " against x right, y down, z forward";
  if (better == named_axes.end()) return {preferred, disagrees + "; no known axes fit"};
  if (asked == PriorAxes::automatic) return {*better, disagrees + "; using " + prior_axes_name(*better)};
  return {preferred, disagrees + "; " + prior_axes_name(*better) + " would fit"};
}

}  // namespace traceflow

#include "capture/prior_axes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "capture/surface_points.h"

namespace traceflow {

namespace {

constexpr std::array named_axes = {PriorAxes::opengl, PriorAxes::opencv, PriorAxes::stable_normal};
constexpr double clear = 0.3;    // a correlation that decides
constexpr int64_t enough = 100;  // samples that decide

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

void add_view(const PriorView& view, const SurfacePoints& points, Sums& sums) {
  points.for_each_visible(view.camera, [&](const Vec2<float>& at, const Vec3<double>& truth) {
    const Vec3<double> prior =
        load3<double>(&view.normal(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x), 0));
    if (prior != Vec3<double>(0)) sums.add(prior, truth);
  });
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
  const SurfacePoints surface(points);
  for (const PriorView& view : views) add_view(view, surface, sums);
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

#include "capture/prior_axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "capture/surface_points.h"

namespace traceflow {

namespace {

constexpr std::array named_axes = {PriorAxes::opengl, PriorAxes::opencv, PriorAxes::stable_normal};
constexpr int64_t enough = 100;  // samples needed to decide an axis

bool decides(double correlation) { return std::abs(correlation) >= 0.3; }

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
  points.for_each_visible(view.camera, [&](const Vec2<float>& at, float, const Vec3<double>& truth) {
    const Vec3<double> prior =
        load3<double>(&view.normal(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x), 0));
    if (prior != Vec3<double>(0)) sums.add(prior, truth);
  });
}

std::string signs_text(const Vec3<double>& correlation) {
  std::string text;
  for (int axis = 0; axis < 3; ++axis) {
    const double c = correlation[axis];
    text += std::string(axis == 0 ? "" : " ") + "xyz"[axis] + (!decides(c) ? '?' : c > 0 ? '+' : '-');
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

std::vector<const View*> views_for_axes(std::vector<const View*> with_priors) {
  constexpr size_t most = 6;
  std::ranges::stable_sort(with_priors, {}, &View::time);
  with_priors.resize(std::min(with_priors.size(), most));
  return with_priors;
}

std::vector<PriorAxes> agreeing_axes(const AxisEvidence& evidence) {
  std::vector<PriorAxes> agreeing;
  std::ranges::copy_if(named_axes, std::back_inserter(agreeing), [&](PriorAxes axes) {
    const Vec3<double> signs = prior_axis_signs(axes);
    for (int axis = 0; axis < 3; ++axis) {
      if (decides(evidence.correlation[axis]) && evidence.correlation[axis] * signs[axis] < 0) return false;
    }
    return true;
  });
  return agreeing;
}

bool decides_all(const AxisEvidence& evidence) {
  const Vec3<double>& c = evidence.correlation;
  return decides(c.x) && decides(c.y) && decides(c.z);
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
  const std::vector<PriorAxes> agreeing = agreeing_axes(evidence);
  if (std::ranges::find(agreeing, preferred) != agreeing.end()) return {preferred, ""};
  const std::string disagrees = "normal priors: the axes " + prior_axes_name(preferred) +
                                " disagree with the geometry, which reads " +
                                signs_text(evidence.correlation) + " against x right, y down, z forward";
  if (agreeing.empty()) return {preferred, disagrees + "; no known axes fit"};
  const std::string better = prior_axes_name(agreeing.front());
  if (asked == PriorAxes::automatic) return {agreeing.front(), disagrees + "; using " + better};
  return {preferred, disagrees + "; " + better + " would fit"};
}

}  // namespace traceflow

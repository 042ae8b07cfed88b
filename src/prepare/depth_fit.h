#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/capture.h"
#include "capture/surface_points.h"

namespace traceflow::prepare {

// What the values of a depth estimator are, up to a scale and a shift for each view: depths, or inverse
// depths.
enum class DepthKind { automatic, depth, inverse };
constexpr std::array<std::string_view, 3> enum_names(DepthKind) { return {"automatic", "depth", "inverse"}; }

// A point of the capture in one view: what the estimator says there, and its camera z.
struct DepthSample {
  double value = 0, depth = 0;
};

// depth = scale · value + shift, or 1 / depth = scale · value + shift.
struct DepthFit {
  DepthKind kind = DepthKind::depth;
  double scale = 1, shift = 0;
  double inliers = 0;  // share of the samples whose depth it gives to within a tenth
  double error = 0;    // median relative error over these

  // 0 where the fit gives no positive depth.
  double depth_of(double value) const;
};

// Fits the samples of one view by random sampling (RANSAC, fixed seed), because up to half of the points are
// hidden or have moved, and then by least squares of the relative error. Returns nothing if there are fewer
// than 16 samples, if the fit holds for fewer than a third of them, or if one depth for all fits about as
// well. kind: not automatic.
std::optional<DepthFit> fit_depths(const std::vector<DepthSample>& samples, DepthKind kind);

// The samples of one view: points outside its mask, because things in the mask have moved away from theirs.
// points: the capture's. values: H×W over the stored image, NaN where there is none. Depths are in the
// capture's units.
std::vector<DepthSample> depth_samples(const Capture& capture, const SurfacePoints& points, const View& view,
                                       const Tensor<float>& values);

// The views that could be fitted, by id.
struct DepthFits {
  DepthKind kind = DepthKind::depth;
  std::map<std::string, DepthFit> of_view;

  // The median over the views.
  double error() const;
};
// automatic: the kind for which more samples of all views fit.
DepthFits fit_views(const std::map<std::string, std::vector<DepthSample>>& samples, DepthKind kind);

}  // namespace traceflow::prepare

#pragma once

#include <string>
#include <vector>

#include "base/tensor.h"
#include "capture/capture.h"
#include "math/camera.h"

// Determines the axes of normal priors from the geometry (docs/captures.md).
namespace traceflow {

Vec3<double> prior_axis_signs(PriorAxes axes);  // relative to OpenCV's; not for `automatic`
std::string prior_axes_name(PriorAxes axes);

// One view's priors, in their own axes, with the view's camera.
struct PriorView {
  Camera<float> camera;
  Tensor<float> normal;  // H×W×3, unit or zero
};

// For each axis, the correlation of the priors, in their own axes, with the geometry's normals in OpenCV's
// axes; 0 if unknown.
struct AxisEvidence {
  Vec3<double> correlation{0};
  int64_t samples = 0;
};

// The geometry's normals belong to planes through each visible point's neighbours and are turned to the
// viewer. Without points only z is known, since visible surfaces face the camera.
AxisEvidence measure_prior_axes(const Tensor<float>& points, const std::vector<PriorView>& views);

// The few views, nearest to time 0 (when the points were there), on which the axes are measured.
std::vector<const View*> views_for_axes(std::vector<const View*> with_priors);

// The known axes that contradict no axis that the evidence decides.
std::vector<PriorAxes> agreeing_axes(const AxisEvidence& evidence);
// Whether the evidence decides all three axes.
bool decides_all(const AxisEvidence& evidence);

// The axes to use for a requested setting, with a warning if the evidence contradicts them (empty: no
// warning).
struct AxisChoice {
  PriorAxes axes = PriorAxes::opengl;
  std::string warning;
};
AxisChoice choose_prior_axes(PriorAxes asked, const AxisEvidence& evidence);

}  // namespace traceflow

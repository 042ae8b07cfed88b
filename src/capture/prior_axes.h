#pragma once

#include <string>
#include <vector>

#include "base/tensor.h"
#include "capture/capture.h"
#include "math/camera.h"

// Which way the axes of normal priors point, read off the geometry (docs/captures.md).
namespace traceflow {

Vec3<double> prior_axis_signs(PriorAxes axes);  // of any but `automatic`, against OpenCV's
std::string prior_axes_name(PriorAxes axes);

// One view's priors, in their own axes, and the camera that they belong to.
struct PriorView {
  Camera<float> camera;
  Tensor<float> normal;  // H×W×3, unit or zero
};

// Per axis the correlation of the priors, in their own axes, with the geometry's normals in OpenCV's; 0 where
// nothing is known.
struct AxisEvidence {
  Vec3<double> correlation{0};
  int64_t samples = 0;
};

// The geometry's normals are planes through each point's neighbours, turned to the viewer, at points that no
// nearer one hides. Without points only z is known: what is seen faces the camera.
AxisEvidence measure_prior_axes(const Tensor<float>& points, const std::vector<PriorView>& views);

// A few of the views, those nearest to time 0, when the points were there: what the axes are measured on.
std::vector<const View*> views_for_axes(std::vector<const View*> with_priors);

// The known axes in which no axis that the evidence decides points the other way.
std::vector<PriorAxes> agreeing_axes(const AxisEvidence& evidence);
// Whether it decides all three.
bool decides_all(const AxisEvidence& evidence);

// The axes to use for what was asked, and a warning where the evidence speaks against them (empty: none).
struct AxisChoice {
  PriorAxes axes = PriorAxes::opengl;
  std::string warning;
};
AxisChoice choose_prior_axes(PriorAxes asked, const AxisEvidence& evidence);

}  // namespace traceflow

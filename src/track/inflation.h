#pragma once

#include <optional>
#include <vector>

#include "base/tensor.h"
#include "math/camera.h"

// A first shape of a thing that no point lies on: its silhouette, inflated.
namespace traceflow {

// How far from the camera's plane a thing is whose silhouette a part of a mask (indices of its pixels) is:
// as far as the nearest of what stands beside it, for what it hides is farther, and what it stands on is not.
// Of the points (P×3) in no part of the mask (H×W), the eight nearest in the picture to each pixel of the
// outline count: a tenth of the outline has two of them that are nearer. None where points are half the
// part's size away.
std::optional<float> depth_beside(const std::vector<int64_t>& part, const Tensor<uint8_t>& mask,
                                  const Camera<float>& camera, const Tensor<float>& points);

// Points of a surface that is as high over the plane of its outline, towards the camera, as a circle through
// the outline is round: a disc becomes half a ball. One for each pixel, or evenly fewer, `most` at most.
Tensor<float> inflated(const std::vector<int64_t>& part, const Camera<float>& camera, float depth,
                       int64_t most);

}  // namespace traceflow

#pragma once

#include <optional>
#include <vector>

#include "base/tensor.h"
#include "math/camera.h"

// The initial shape of a thing without points: its inflated silhouette.
namespace traceflow {

// The depth of the thing whose silhouette is `part` (pixel indices): that of the nearest surface beside it.
// Surface that the thing hides is farther away, but the surface that it rests on is not. Candidates are
// points (P×3) outside all parts of the mask (H×W). Of the eight nearest in the image to each outline pixel,
// the second smallest depth counts; the result is the lowest tenth percentile over the outline. Returns
// nothing if the points are farther away than half the part's size.
std::optional<float> depth_beside(const std::vector<int64_t>& part, const Tensor<uint8_t>& mask,
                                  const Camera<float>& camera, const Tensor<float>& points);

// Points of a surface that rises above the plane of its outline, towards the camera, like a circle: a disc
// becomes half a ball. One point per pixel, or an evenly thinned set of at most `most`.
Tensor<float> inflated(const std::vector<int64_t>& part, const Camera<float>& camera, float depth,
                       int64_t most);

// Points at a prior's depths (H×W, 0: unknown; may be empty) of the part's pixels, evenly thinned to about
// `most`. The depths are scaled to fit the capture's points beside the part, outside all parts of the mask.
// At the outline a prior's depths are between those of the thing and its background; those farther inside
// count there. No points if fewer than eight points lie beside the part.
Tensor<float> at_depths(const std::vector<int64_t>& part, const Tensor<uint8_t>& mask,
                        const Camera<float>& camera, const Tensor<float>& depth, const Tensor<float>& points,
                        int64_t most);

}  // namespace traceflow

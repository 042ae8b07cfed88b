#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "track/body_surface.h"

namespace traceflow {

// For each body, the ratio of the distance of the capture's points (P×3, positions at the first key) to the
// rendered distance. It is the median over points in the inner part of the body's image that lie within 0.6
// radii of the rendered surface; farther ones are on its back. 1 if there are fewer than 30 points or if the
// difference from 1 is within three standard errors. surface: of the first key.
std::vector<double> distance_by_points(const BodySurface& surface, const Tensor<float>& points,
                                       int64_t bodies);

}  // namespace traceflow

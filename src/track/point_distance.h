#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "track/body_surface.h"

namespace traceflow {

// How many times as far from the camera as they are drawn bodies are by the capture's points (P×3, where
// things are at the first time): of each body the median over the points that show in its inner part and lie
// within 0.6 of its radius from what is drawn there; what is farther is its back. 1 where fewer than 30 tell
// or where it is within three standard errors. surface: of the first key.
std::vector<double> distance_by_points(const BodySurface& surface, const Tensor<float>& points,
                                       int64_t bodies);

}  // namespace traceflow

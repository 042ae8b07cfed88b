#pragma once

#include <vector>

#include "math/types.h"

namespace traceflow {

// 1.1 · the largest distance of a training camera from their mean (method §7.6); 0 where all stand at one
// place. An outlier counts in full.
double camera_extent(const std::vector<Vec3<double>>& positions);

}  // namespace traceflow

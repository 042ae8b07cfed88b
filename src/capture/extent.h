#pragma once

#include <vector>

#include "math/types.h"

namespace traceflow {

// 1.1 · the largest distance of a training camera from the mean of all (method §7.6); 0 if all are at one
// place. Outliers are not excluded.
double camera_extent(const std::vector<Vec3<double>>& positions);

}  // namespace traceflow

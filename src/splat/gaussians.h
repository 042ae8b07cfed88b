#pragma once

#include "scene/surfels.h"

// Between surfels and the 3D Gaussians of other programs, which have a third axis.
namespace traceflow {

// Log of the standard deviation along the normal with which surfel i is written as a 3D Gaussian: one
// hundredth of its smaller one.
float log_thickness(const Surfels& surfels, int64_t i);

// Makes surfels of 3D Gaussians. log_scales: N×3. `surfels` has their rotations and gets the surfels'
// rotations and log_scale: the shortest axis of each Gaussian becomes the normal.
void flatten(const Tensor<float>& log_scales, Surfels& surfels);

}  // namespace traceflow

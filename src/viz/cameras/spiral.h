#pragma once

#include <vector>

#include "viz/cameras/shot.h"

namespace traceflow::viz {

// The camera path of LLFF and NeRF: two turns around the mean of the given cameras, with one movement back
// and forth, always looking at their target. Along each axis of the mean camera, the path extends to the 90th
// percentile of the cameras' distances. Sideways it extends at least 1/50 of the distance to the target, so
// that a scene with a static camera is seen from more than one place. `frames` cameras, named 00000, 00001,
// …, without times, with the first camera's size and focal lengths. The last frame leads smoothly back to the
// first.
std::vector<Shot> spiral_around_cameras(const std::vector<Camera<float>>& cameras, int frames);

}  // namespace traceflow::viz

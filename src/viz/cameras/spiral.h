#pragma once

#include <vector>

#include "viz/cameras/shot.h"

namespace traceflow::viz {

// The path that LLFF and NeRF show their scenes by: two turns around the given cameras' mean, moving back and
// forth once, always looking at what they look at. In each of the mean camera's axes it goes as far as nine
// of ten cameras stand from the mean, and sideways at least 1/50 of the distance to what is looked at, so
// that a resting camera's scene is seen from more than one place. `frames` cameras, named 00000, 00001, …,
// without times, of the first camera's size and focal lengths; the last goes over into the first.
std::vector<Shot> spiral_around_cameras(const std::vector<Camera<float>>& cameras, int frames);

}  // namespace traceflow::viz

#pragma once

#include "base/tensor.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// A path of `frames` cameras around what the given cameras look at, named 00000, 00001, …, without times. It
// keeps to the side from which the scene was seen: it swings over the angle that the given cameras span, as
// wide as 30° at least, and goes all the way round where they span more than 240°. Every frame has the first
// camera's size and focal lengths.
std::vector<Shot> orbit_around_cameras(const std::vector<Camera<float>>& cameras, int frames);

// A full circle around the points' middle (P×3), for a scene that no camera is known of: 45° field of view, y
// down as reconstructions from photographs have it.
std::vector<Shot> orbit_around_points(const Tensor<float>& points, int width, int height, int frames);

}  // namespace traceflow::viz

#pragma once

#include "base/tensor.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// A path of `frames` cameras around the target of the given cameras, named 00000, 00001, …, without times. It
// stays on the side from which the scene was captured: it swings over the angle that the given cameras span,
// at least 30°, and makes a full circle if they span more than 240°. Every frame has the first camera's size
// and focal lengths.
std::vector<Shot> orbit_around_cameras(const std::vector<Camera<float>>& cameras, int frames);

// A full circle around the centre of the points (P×3), for a scene without known cameras: 45° field of view,
// y down as usual in reconstructions from photographs.
std::vector<Shot> orbit_around_points(const Tensor<float>& points, int width, int height, int frames);

}  // namespace traceflow::viz

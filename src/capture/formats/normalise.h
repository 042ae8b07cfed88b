#pragma once

#include <vector>

#include "capture/formats/found_capture.h"

namespace traceflow {

// The normalisation of a capture that does not define one. With points: the box around the inner 95 % of
// points and cameras along each axis gets a diagonal of 1, as in Nerfies, and its centre becomes the origin.
// Without points: if the optical axes meet in front of the cameras, the origin is the point nearest to all of
// them, and the box around it and the cameras gets a diagonal of 1.
SceneNormalisation normalise(const std::vector<FoundView>& views, const std::vector<Vec3<double>>& points);

}  // namespace traceflow

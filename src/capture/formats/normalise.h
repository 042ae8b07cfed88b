#pragma once

#include <vector>

#include "capture/formats/found_capture.h"

namespace traceflow {

// The normalisation of a capture that does not say its own. With points: the box around the inner 95 % of
// points and cameras along each axis gets a diagonal of 1, as Nerfies has it, and its centre becomes the
// origin. Without: the origin is the point nearest to all optical axes, if they meet before the cameras, and
// the diagonal that of the box around it and the cameras.
SceneNormalisation normalise(const std::vector<FoundView>& views, const std::vector<Vec3<double>>& points);

}  // namespace traceflow

#pragma once

#include "capture/motion_truth.h"
#include "scene/motion.h"
#include "scene/normalisation.h"
#include "scene/surfels.h"

namespace traceflow {

// Gives each body at each key the rigid pose that best fits the true motion of its points: the upper bound
// for tracking. A true point belongs to the body of the surfel nearest to it at the first key. A body without
// points stays at rest. surfels and motion are on the CPU, bodies at rest.
void set_true_poses(const MotionTruth& truth, const SceneNormalisation& normalisation, const Surfels& surfels,
                    Motion& motion);

}  // namespace traceflow

#pragma once

#include "capture/motion_truth.h"
#include "scene/motion.h"
#include "scene/normalisation.h"
#include "scene/surfels.h"

namespace traceflow {

// Gives each body at every key the rigid pose that fits the true motion of its points best: the bound of what
// following can find. A true point belongs to the body of the surfel that it is nearest to at the first key.
// A body without points stands still. surfels and motion on the CPU, bodies at rest.
void set_true_poses(const MotionTruth& truth, const SceneNormalisation& normalisation, const Surfels& surfels,
                    Motion& motion);

}  // namespace traceflow

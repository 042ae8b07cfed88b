#pragma once

#include "track/pose_solver.h"

namespace traceflow {

// Finds bodies again that have lost their place at a key: that show nothing in the first target, or hardly
// anything inside its mask. Each is put where the largest part of the mask is that no body covers, as far
// away as that part's size says, and solved for from several turns: as at the key before, and turned by 0.4
// and 0.9 radians about each axis either way. The best is kept if it explains the targets better. Where no
// such part is large enough, the body is left alone. Returns how many were found.
int find_lost_bodies(PoseSolver& solver, const Surfels& main, Motion& motion, int64_t key,
                     const TrackWeights& weights, const PoseSteps& steps);

}  // namespace traceflow

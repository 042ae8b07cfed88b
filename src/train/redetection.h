#pragma once

#include "train/pose_solver.h"

namespace traceflow {

// Finds bodies again that were lost: that show nothing in the solver's first target, or hardly anything
// inside its mask, while a part of the mask is covered by none. Each is put where the largest such part is,
// as far away as the part's size says, and is solved for from several turns. The best is kept if it explains
// the target better than the body as it stood. previous: the key at which the bodies were last where they
// belong. Returns how many were found.
int find_lost_bodies(PoseSolver& solver, const Surfels& main, Motion& motion, int64_t key, int64_t previous,
                     const TrackWeights& weights, const PoseSteps& steps);

}  // namespace traceflow

#pragma once

#include "track/pose_solver.h"

namespace traceflow {

// Finds bodies that were lost at a key: those invisible in the first target, or hardly inside its mask. Each
// is moved to the largest part of the mask that no other body covers, at the distance given by that part's
// size. It is solved from several rotations: that of the previous key, and ±0.4 and ±0.9 radians about each
// axis from it. The best is kept if it costs less. If no such part is large enough, the body stays as it is.
// Returns the number of bodies found.
int find_lost_bodies(PoseSolver& solver, const Surfels& main, Motion& motion, int64_t key,
                     const TrackWeights& weights, const PoseSteps& steps);

}  // namespace traceflow

#pragma once

#include "ops/raster/raster.h"
#include "scene/motion.h"
#include "scene/surfels.h"
#include "track/pose_solver.h"

namespace traceflow {

// Surfels for surface of bodies that has come into view at a key: one for each pixel of the target that lies
// inside its mask, the edge left out, and that no body covers, within six pixels of one that a body covers.
// Each lies where the planes of its neighbours meet its ray, faces as the normal prior says (without one as
// the neighbours do) and has the pixel's colour. At rest; rows of the groups and degree of `surfels`; at most
// `limit`, nearest to what was covered first. options: how pictures are drawn. Everything on the CPU.
Surfels new_surface(const TrackTarget& target, const Motion& motion, int64_t key, const Surfels& surfels,
                    const raster::Options& options, float tint, int64_t limit);

}  // namespace traceflow

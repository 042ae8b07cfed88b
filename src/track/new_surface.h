#pragma once

#include "ops/raster/raster.h"
#include "scene/motion.h"
#include "scene/surfels.h"
#include "track/pose_solver.h"

namespace traceflow {

// Surfels for the surface of bodies that has become visible at a key. There is one for each pixel inside the
// target's mask, except at its edge, that no body covers and that is within six pixels of a covered one. It
// lies where the planes of its neighbours meet its ray, has the prior's normal (or that of the neighbours if
// there is none) and the pixel's colour. The result is at rest, has the fields and degree of `surfels`, and
// at most `limit` rows, those nearest to covered pixels first. options: of the rasteriser. Everything is on
// the CPU.
Surfels new_surface(const TrackTarget& target, const Motion& motion, int64_t key, const Surfels& surfels,
                    const raster::Options& options, float tint, int64_t limit);

}  // namespace traceflow

#pragma once

#include <cstdint>

#include "math/types.h"
#include "scene/motion.h"

namespace traceflow {

// Changes the point about which a body rotates (Motion::centre; world, at rest). The positions of its points
// at all keys stay the same.
void move_centre(int32_t body, const Vec3<double>& centre, Motion& motion);

}  // namespace traceflow

#pragma once

#include <cstdint>

#include "math/types.h"
#include "scene/motion.h"

namespace traceflow {

// Makes a body turn about another point (Motion::centre; world, at rest). Its points stay where they are at
// every key.
void move_centre(int32_t body, const Vec3<double>& centre, Motion& motion);

}  // namespace traceflow

#pragma once

#include <limits>

#include "math/types.h"

namespace traceflow::synth {

using Vector = Vec3<double>;

// How far a ray that misses goes.
constexpr double infinity = std::numeric_limits<double>::infinity();

// direction has unit length.
struct Ray {
  Vector origin;
  Vector direction;
};

}  // namespace traceflow::synth

#pragma once

#include <limits>

#include "math/types.h"

namespace traceflow::synth {

using Vector = Vec3<double>;

// The distance of a ray that hits nothing.
constexpr double infinity = std::numeric_limits<double>::infinity();

// direction has unit length.
struct Ray {
  Vector origin;
  Vector direction;
};

}  // namespace traceflow::synth

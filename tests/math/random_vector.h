#pragma once

#include "base/random.h"
#include "math/types.h"

namespace traceflow {

inline Vec3<double> random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

}  // namespace traceflow

#pragma once

#include <algorithm>
#include <cmath>

#include "scene/surfels.h"

namespace traceflow::trace {

// Whether all of n numbers are finite, without branches: 0 · x is 0 for finite x only.
template <class T>
bool all_finite(const T* values, int64_t n) {
  T sum(0);
  for (int64_t i = 0; i < n; ++i) sum += T(0) * values[i];
  return sum == T(0);
}

// Whether surfel i can be hit at all: finite, of positive area, of an opacity that reaches alpha_min.
template <class T>
bool is_usable(const BasicPosedSurfels<T>& surfels, int64_t i, T alpha_min) {
  const T* scale = surfels.scale.row(i);
  return all_finite(surfels.position.row(i), 3) && all_finite(scale, 2) &&
         all_finite(surfels.rotation.row(i), 4) && all_finite(surfels.sh.row(i), surfels.sh.row_size()) &&
         scale[0] > T(0) && scale[1] > T(0) && std::isfinite(surfels.opacity[i]) &&
         surfels.opacity[i] >= alpha_min;
}

// Whether a ray can be traced: finite, with a direction.
template <class T>
bool is_traceable(const T* origin, const T* direction) {
  return all_finite(origin, 3) && all_finite(direction, 3) &&
         (direction[0] != T(0) || direction[1] != T(0) || direction[2] != T(0));
}

}  // namespace traceflow::trace

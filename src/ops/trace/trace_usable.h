#pragma once

#include <algorithm>
#include <cmath>

#include "math/rotation.h"
#include "math/surfel_hit.h"
#include "scene/surfels.h"

namespace traceflow::trace {

// Addresses of a set of posed surfels, on either device.
template <class T>
struct SurfelView {
  const T *position, *scale, *rotation, *opacity, *sh;
  int64_t sh_numbers;  // of one surfel

  SurfelView(const BasicPosedSurfels<T>& s)
      : position(s.position.data()),
        scale(s.scale.data()),
        rotation(s.rotation.data()),
        opacity(s.opacity.data()),
        sh(s.sh.data()),
        sh_numbers(s.sh.row_size()) {}

  // Returns whether surfel i can be hit: finite, with positive area and with an opacity of at least
  // alpha_min.
  TRACEFLOW_HD bool is_usable(int64_t i, T alpha_min) const {
    return all_finite(position + 3 * i, 3) && all_finite(scale + 2 * i, 2) &&
           all_finite(rotation + 4 * i, 4) && all_finite(sh + sh_numbers * i, sh_numbers) &&
           scale[2 * i] > T(0) && scale[2 * i + 1] > T(0) && std::isfinite(opacity[i]) &&
           opacity[i] >= alpha_min;
  }
  TRACEFLOW_HD SurfelFrame<T> frame(int64_t i) const {
    return {load3<T>(position + 3 * i),
            rotation_from_quaternion(load4<T>(rotation + 4 * i)),
            {scale[2 * i], scale[2 * i + 1]}};
  }
};

template <class T>
bool is_usable(const BasicPosedSurfels<T>& surfels, int64_t i, T alpha_min) {
  return SurfelView<T>(surfels).is_usable(i, alpha_min);
}

// Returns whether a ray can be traced: finite, with a non-zero direction.
template <class T>
TRACEFLOW_HD bool is_traceable(const T* origin, const T* direction) {
  return all_finite(origin, 3) && all_finite(direction, 3) &&
         (direction[0] != T(0) || direction[1] != T(0) || direction[2] != T(0));
}
// Returns whether the width of a cone is valid: finite and not negative.
template <class T>
TRACEFLOW_HD bool is_width(T width) {
  return std::isfinite(width) && width >= T(0);
}

}  // namespace traceflow::trace

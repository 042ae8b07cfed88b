#pragma once

#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_hit.h"
#include "scene/surfels.h"

// Addresses of a set of posed surfels, for steps that run on either device.
namespace traceflow {

template <class T>
struct BasicPosedSurfelsView {
  T *position, *scale, *rotation, *opacity, *sh;
  T *tint, *in_body, *roughness;  // null if absent
  int64_t count;
  int64_t sh_row;  // numbers of harmonics per surfel
  int sh_degree;
};
using PosedSurfelsView = BasicPosedSurfelsView<const float>;
using MutablePosedSurfelsView = BasicPosedSurfelsView<float>;

namespace detail {
template <class View, class Surfels>
View view_of(Surfels& s) {
  const int64_t count = s.count();
  return {s.position.data(),
          s.scale.data(),
          s.rotation.data(),
          s.opacity.data(),
          s.sh.data(),
          s.has_tint() ? s.tint.data() : nullptr,
          s.in_body.empty() ? nullptr : s.in_body.data(),
          s.has_roughness() ? s.roughness.data() : nullptr,
          count,
          count > 0 ? s.sh.row_size() : 0,
          count > 0 ? sh_degree(s.sh.dim(1)) : 0};
}
}  // namespace detail

inline PosedSurfelsView view_of(const PosedSurfels& s) { return detail::view_of<PosedSurfelsView>(s); }
inline MutablePosedSurfelsView view_of(PosedSurfels& s) {
  return detail::view_of<MutablePosedSurfelsView>(s);
}

// A surfel's frame in double precision.
TRACEFLOW_HD inline SurfelFrame<double> surfel_frame(const PosedSurfelsView& surfels, int64_t i) {
  return {load3<double>(surfels.position + 3 * i),
          rotation_from_quaternion(load4<double>(surfels.rotation + 4 * i)),
          {surfels.scale[2 * i], surfels.scale[2 * i + 1]}};
}

}  // namespace traceflow

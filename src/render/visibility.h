#pragma once

#include "math/camera.h"
#include "scene/surfels.h"

namespace traceflow {

// Lists, ascending, the stored surfels that can show in the camera's image when the field moves each by at
// most *max_displacement (null: no field moves them; an address where the surfels are): the sphere around the
// stored centre, wide enough for the surfel's disk and for a low-pass of so many pixels, meets the view's
// pyramid in front of near_plane. A surfel whose stored values are not finite is left out; one that a body
// carries is listed. Runs where the surfels are; `in_view` is put there.
void surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane, float low_pass,
                     const float* max_displacement, Tensor<int32_t>& in_view);
inline Tensor<int32_t> surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane,
                                       const float* max_displacement = nullptr) {
  Tensor<int32_t> in_view;
  surfels_in_view(surfels, camera, near_plane, 1, max_displacement, in_view);
  return in_view;
}

}  // namespace traceflow

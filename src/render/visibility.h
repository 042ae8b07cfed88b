#pragma once

#include "math/camera.h"
#include "scene/surfels.h"

namespace traceflow {

// Lists, in ascending order, the stored surfels that may be visible to the camera if the field moves each by
// at most *max_displacement (on the device of the surfels; null: no field). A surfel is visible if the sphere
// around its stored centre meets the view frustum beyond near_plane. The sphere contains the surfel's disk
// and a low-pass of `low_pass` pixels. Leaves out surfels with stored values that are not finite; always
// lists surfels of bodies. Runs on the device of the surfels, where it puts `in_view`.
void surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane, float low_pass,
                     const float* max_displacement, Tensor<int32_t>& in_view);
inline Tensor<int32_t> surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane,
                                       const float* max_displacement = nullptr) {
  Tensor<int32_t> in_view;
  surfels_in_view(surfels, camera, near_plane, 1, max_displacement, in_view);
  return in_view;
}

}  // namespace traceflow

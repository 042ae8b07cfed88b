#pragma once

#include "math/camera.h"
#include "scene/surfels.h"

namespace traceflow {

// Indices (ascending) of stored surfels that can show in the camera's image when the field moves each by at
// most `reach`: the sphere around the stored centre, wide enough for the surfel's disk, meets the view's
// pyramid in front of near_plane. A surfel whose stored values are not finite is left out.
Tensor<int32_t> surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane,
                                float reach);

}  // namespace traceflow

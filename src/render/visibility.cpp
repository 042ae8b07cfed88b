#include "render/visibility.h"

#include "primitives/list_where.h"
#include "render/frame_kernels.h"

namespace traceflow {

void surfels_in_view(const Surfels& surfels, const Camera<float>& camera, float near_plane, float low_pass,
                     const float* max_displacement, Tensor<int32_t>& in_view) {
  list_where(
      surfels.device(), "render: view culling", surfels.count(),
      CanShow{camera, ViewPyramid(camera), surfels.position.data(), surfels.log_scale.data(), near_plane,
              low_pass, max_displacement, surfels.body.empty() ? nullptr : surfels.body.data()},
      in_view);
}

}  // namespace traceflow

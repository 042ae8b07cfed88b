#include "splat/gaussians.h"

#include <algorithm>

#include "math/rotation_group.h"

namespace traceflow {

namespace {

// Two decimal orders.
constexpr float log_hundred = 4.6051702F;

}  // namespace

float log_thickness(const Surfels& surfels, int64_t i) {
  const float* s = surfels.log_scale.row(i);
  return std::min(s[0], s[1]) - log_hundred;
}

void flatten(const Tensor<float>& log_scales, Surfels& surfels) {
  // Rotations of 120° about (1, 1, 1), which turn the axes t_u, t_v, n into the axes 1, 2, 0 or 2, 0, 1.
  const Vec4<double> third_turn(0.5, 0.5, 0.5, 0.5), two_thirds(0.5, -0.5, -0.5, -0.5);
  const int64_t n = log_scales.dim(0);
  surfels.log_scale = Tensor<float>(Shape{n, 2});
  for (int64_t i = 0; i < n; ++i) {
    const float* s = log_scales.row(i);
    int normal = 2;
    for (const int axis : {0, 1}) {
      if (s[axis] < s[normal]) normal = axis;
    }
    surfels.log_scale(i, 0) = s[(normal + 1) % 3];
    surfels.log_scale(i, 1) = s[(normal + 2) % 3];
    if (normal == 2) continue;
    float* rotation = surfels.rotation.row(i);
    const Vec4<double> turned = quaternion_product<double>(
        {rotation[0], rotation[1], rotation[2], rotation[3]}, normal == 0 ? third_turn : two_thirds);
    for (int c = 0; c < 4; ++c) rotation[c] = static_cast<float>(turned[c]);
  }
}

}  // namespace traceflow

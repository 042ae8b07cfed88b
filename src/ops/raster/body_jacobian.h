#pragma once

#include "ops/raster/raster.h"

// Derivatives of the image by the poses of rigid bodies, for tracking. Forward mode: few parameters, many
// pixels.
namespace traceflow::raster {

// Call after forward() on the CPU with sort = centre and `saved`, with the same surfels, camera and options.
// Sets jacobian (H×W×(6·B)×7, resized) to the exact derivatives of tint, normal (world axes) and colour. They
// are by ω_x, ω_y, ω_z (radians, about the body's pivot, world axes) and by the shift s_x, s_y, s_z (scene
// units) of each body. body: one number for each posed surfel, −1 to B − 1; negative for a surfel of no body.
// pivot: B×3, world. The order and cut-offs of the blend are constants, as in backward(). So are colours,
// although they depend on the viewing direction.
void body_jacobian(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
                   const Camera<float>& camera, const Options& options, const Saved& saved,
                   Tensor<float>& jacobian);

}  // namespace traceflow::raster

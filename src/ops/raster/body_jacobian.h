#pragma once

#include "ops/raster/raster.h"

// What tracking needs of rigid bodies: how the picture changes with their poses (forward mode: a few
// directions for many pixels).
namespace traceflow::raster {

// After forward on the CPU with sort = centre and `saved`, of the same surfels, camera and options: the exact
// derivatives of tint, normal (world axes) and colour, H×W×(6·B)×7, resized. By ω_x, ω_y, ω_z (radians, about
// the body's pivot, world axes) and the shift s_x, s_y, s_z (scene units) of each body. body: of each posed
// surfel, −1 to B − 1; under 0 nothing carries it. pivot: B×3, world. Order and cut-offs of the blend are
// held still, as backward does, and so are colours, which depend on the side that a surfel is seen from.
void body_jacobian(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
                   const Camera<float>& camera, const Options& options, const Saved& saved,
                   Tensor<float>& jacobian);

}  // namespace traceflow::raster

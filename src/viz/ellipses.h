#pragma once

#include "ops/raster/raster.h"

namespace traceflow::viz {

// The least opacity of a surfel that is shown as an ellipse.
inline constexpr float least_shown_opacity = 0.05F;

// H×W×3 in [0, 1]: every surfel as an opaque disk out to one standard deviation, in the colour that it has
// seen from the camera, darker where it is seen from the side and at its rim, so that surfels are told apart;
// the nearest wins, and of two at one depth the first. Hits nearer than the near plane and surfels that the
// rasteriser skips are left out; where none is, the background. On the host, wherever the surfels are. The
// same bytes at any number of threads.
Tensor<float> surfel_ellipses(const PosedSurfels& surfels, const Camera<float>& camera,
                              const raster::Options& options);

// What a surfel of this colour shows at a place on it: facing is the cosine between its normal and the ray,
// rho the square of the distance from its centre in standard deviations.
Vec3<float> ellipse_colour(const Vec3<float>& colour, double facing, double rho);

}  // namespace traceflow::viz

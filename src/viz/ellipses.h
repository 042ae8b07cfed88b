#pragma once

#include "ops/raster/raster.h"

namespace traceflow::viz {

// The minimum opacity of a surfel that is drawn as an ellipse.
inline constexpr float least_shown_opacity = 0.05F;

// H×W×3 in [0, 1]: every surfel as an opaque disk with a radius of one standard deviation, in its colour as
// seen from the camera. It is darker at its rim and at grazing angles, so that surfels can be told apart. The
// nearest disk wins; at equal depth the first. Hits nearer than the near plane, and surfels that the
// rasteriser skips, are left out. Pixels without a surfel have the background. Returned on the host for
// surfels on any device. The result is the same to the byte for any number of threads.
Tensor<float> surfel_ellipses(const PosedSurfels& surfels, const Camera<float>& camera,
                              const raster::Options& options);

// The colour at a point of a surfel of this colour: facing is the cosine between its normal and the ray, rho
// the squared distance from its centre in standard deviations.
Vec3<float> ellipse_colour(const Vec3<float>& colour, double facing, double rho);

}  // namespace traceflow::viz

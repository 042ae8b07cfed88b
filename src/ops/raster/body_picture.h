#pragma once

#include "ops/raster/raster.h"

// What tracking sees of rigid bodies: where they cover the picture, how it is turned there and its colour,
// with exact derivatives by their poses (forward mode: a few directions for many pixels).
namespace traceflow::raster {

struct BodyPicture {
  // Where a tile of 16×16 pixels has no carried surfel these are 0, as are their derivatives.
  Tensor<float> silhouette;  // H×W, Σ w over the surfels of all bodies
  Tensor<float> normal;      // H×W×3, world axes, Σ w n of every surfel, as raster::BasicOutput has it
  Tensor<float> colour;      // H×W×3, Σ w c of every surfel, as raster::BasicOutput has it
  // H×W×(6·B)×7: by ω_x, ω_y, ω_z (radians, about the body's pivot, world axes) and the shift s_x, s_y, s_z
  // (scene units) of each body: of the silhouette, the three normal components and the three of the colour,
  // whose dependence on the side that a surfel is seen from is left out.
  Tensor<float> jacobian;
};

// Draws posed surfels on the CPU in the order of their centres. body: of each posed surfel, −1 to B − 1.
// pivot: B×3, world. Derivatives hold the order and the cut-offs of the blend still, as raster::backward
// does.
void draw_bodies(const PosedSurfels& surfels, const Tensor<int32_t>& body, const Tensor<float>& pivot,
                 const Camera<float>& camera, const Options& options, BodyPicture& picture);

}  // namespace traceflow::raster

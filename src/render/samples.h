#pragma once

#include "math/camera.h"
#include "ops/raster/raster.h"

// Supersampling (method §3.6): the surfels are drawn for a picture n times as wide and as high, whose layers
// are averaged.
namespace traceflow::samples {

// The camera of that picture.
Camera<float> camera_of(const Camera<float>& camera, int per_side);

// The layers of the picture (resized) from those of its samples: means, the depth weighted by alpha, the
// median depth of the samples that have one.
void average(const raster::Output& samples, int per_side, raster::Output& picture);

// Sets the gradients of the samples' layers (resized; empty where those of the picture's are, but for alpha,
// on which depths depend).
void average_backward(const raster::Output& samples, const raster::Output& picture, int per_side,
                      const raster::OutputGradient& grad_picture, raster::OutputGradient& grad_samples);

}  // namespace traceflow::samples

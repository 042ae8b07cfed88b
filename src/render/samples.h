#pragma once

#include "math/camera.h"
#include "ops/raster/raster.h"

// Supersampling (method §3.6): the surfels are drawn, mirrored and shaded for a picture n times as wide and
// as high, whose layers are averaged.
namespace traceflow::samples {

// Samples along a pixel's side for a camera, at most `most`: as many for an angle as photographs of this
// focal length (pixels; 0: any) have with `per_side`, since the low-pass that surfels were trained with is as
// wide as a sample. Up to a tenth fewer count as enough.
int samples_for(const Camera<float>& camera, int per_side, float focal, int most);

// Width of the low-pass, in samples of a picture that has `samples` along a pixel's side: as wide for an
// angle as a sample of those photographs, but no narrower than a sample of the picture.
float low_pass_for(const Camera<float>& camera, int samples, int per_side, float focal);

// The camera of that picture.
Camera<float> camera_of(const Camera<float>& camera, int per_side);

// The mean over each pixel's samples (H×W×C; picture resized), and its derivative (samples resized).
void average(const Tensor<float>& samples, int per_side, Tensor<float>& picture);
void average_backward(const Tensor<float>& grad_picture, int per_side, Tensor<float>& grad_samples);

// The layers of the picture (resized) from those of its samples: means, the depth weighted by alpha, the
// median depth of the samples that have one.
void average(const raster::Output& samples, int per_side, raster::Output& picture);

// Sets the gradients of the samples' layers (resized; empty where those of the picture's are, but for alpha,
// on which depths depend).
void average_backward(const raster::Output& samples, const raster::Output& picture, int per_side,
                      const raster::OutputGradient& grad_picture, raster::OutputGradient& grad_samples);

}  // namespace traceflow::samples

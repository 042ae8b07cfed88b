#pragma once

#include "math/camera.h"
#include "ops/raster/raster.h"

// Supersampling (method §3.6): surfels are rasterised, reflected and shaded for an image n times as wide and
// as high, whose layers are then averaged.
namespace traceflow::samples {

// The number of samples along a pixel's side for a camera, at most `most`. Samples have the angular size of
// those in training: `per_side` in a pixel of photographs with the focal length `focal` (pixels; 0: unknown).
// The reason is that surfels are trained with a low-pass as wide as a sample. Up to a tenth fewer are
// accepted.
int samples_for(const Camera<float>& camera, int per_side, float focal, int most);

// The width of the low-pass in samples, for `samples` along a pixel's side. It has the angular size of a
// sample in training, but is at least one sample of the image.
float low_pass_for(const Camera<float>& camera, int samples, int per_side, float focal);

// The camera of the image of the samples.
Camera<float> camera_of(const Camera<float>& camera, int per_side);

// The mean over each pixel's samples (H×W×C; picture resized), and its derivative (samples resized).
void average(const Tensor<float>& samples, int per_side, Tensor<float>& picture);
void average_backward(const Tensor<float>& grad_picture, int per_side, Tensor<float>& grad_samples);

// The layers of an image (resized) from those of its samples: means, with the depth weighted by alpha. The
// median depth is the mean over the samples that have one.
void average(const raster::Output& samples, int per_side, raster::Output& picture);

// Sets the gradients of the samples' layers (resized). A gradient is empty if that of the image is, except
// that of alpha, on which the depth depends.
void average_backward(const raster::Output& samples, const raster::Output& picture, int per_side,
                      const raster::OutputGradient& grad_picture, raster::OutputGradient& grad_samples);

}  // namespace traceflow::samples

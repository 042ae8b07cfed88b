#pragma once

#include "base/tensor.h"
#include "capture/lens/lens.h"

// Resamples images H×W×C to other pixel grids.
namespace traceflow {

// A grid of width×height pixels over an image. Each covers step_x × step_y pixels of the image; the first
// starts at the image's corner.
struct Grid {
  int64_t width = 0, height = 0;
  double step_x = 1, step_y = 1;
};

// Mean over the area of each pixel; bilinear along a side with a step below 1.
Tensor<float> resample(const Tensor<float>& image, const Grid& grid);

// The image of an ideal pinhole with the lens's principal point and `zoom` times its focal length. Bilinear;
// the border is replicated. The image has the lens's size.
Tensor<float> straighten(const Tensor<float>& image, const Lens& lens, double zoom);
// The same with the nearest pixel, for values that must not be mixed.
Tensor<float> straighten_nearest(const Tensor<float>& image, const Lens& lens, double zoom);

}  // namespace traceflow

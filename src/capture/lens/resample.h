#pragma once

#include "base/tensor.h"
#include "capture/lens/lens.h"

// Images H×W×C onto other pixel grids.
namespace traceflow {

// A grid of width×height pixels laid over an image: each covers step_x × step_y of the image's pixels, the
// first begins at the image's corner.
struct Grid {
  int64_t width = 0, height = 0;
  double step_x = 1, step_y = 1;
};

// Mean over the area that each pixel covers; bilinear along a side whose step is below 1.
Tensor<float> resample(const Tensor<float>& image, const Grid& grid);

// What an ideal pinhole with the lens's principal point and `zoom` times its focal length would have seen;
// bilinear, the border replicated. The image has the lens's size.
Tensor<float> straighten(const Tensor<float>& image, const Lens& lens, double zoom);
// The same by nearest pixel, for values that must not mix.
Tensor<float> straighten_nearest(const Tensor<float>& image, const Lens& lens, double zoom);

}  // namespace traceflow

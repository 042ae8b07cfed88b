#pragma once

#include <functional>
#include <vector>

#include "viz/subject.h"

namespace traceflow::viz {

// Harmonics that stand in for traced reflections, and how close they come.
struct Baked {
  Surfels main;  // posed, in scene units, on the host, with harmonics of degree 3
  // Mean PSNR in dB of the captured cameras' images against those with reflections: of these surfels, and of
  // the surfels without reflections.
  double psnr = 0, psnr_without = 0;
};

// Fits the harmonics of `posed` (posed_main at this time) so that rasterising them alone shows what the
// subject's images show with reflections. Least squares over the images of the captured cameras and, for
// views beside them, of as many moved ones; Adam, from the surfels' own colours or, if not null, from the
// harmonics `start`, which are those of a nearby time. The subject may be on any device. progress(done, all)
// is called for each image; if it returns false, the result is as good as it is.
Baked bake(const Subject& subject, float time, const Surfels& posed,
           const std::vector<Camera<float>>& captured, const Tensor<float>* start,
           const std::function<bool(int64_t, int64_t)>& progress);

}  // namespace traceflow::viz

#pragma once

#include <optional>
#include <string>

#include "capture/capture.h"
#include "capture/surface_points.h"

namespace traceflow {

// What one view's pixels show.
struct ViewFacts {
  const View* view = nullptr;
  std::string broken;  // why a file cannot be read; the rest is then as it stands here
  bool is_uniform = false;
  double mean_colour = 0;          // in [0, 1]
  std::optional<double> exposure;  // stops: mean log₂ of the luminance of what is not black
  double sharpness = 0;       // variance of the Laplacian over that of the picture: light does not change it
  Tensor<uint8_t> thumbnail;  // grey, H×W
  std::optional<double> masked, with_prior;   // shares of the pixels
  std::optional<double> noise, masked_noise;  // standard deviations in 8-bit levels, all over and in the mask
  std::optional<double> prior_angle;  // degrees: mean, outside the mask, from planes through the points
};

// Decodes the view, past the cache.
ViewFacts measure_view(const Capture& capture, const View& view, const SurfacePoints& surface);

// For tests and for what has pixels already.
std::optional<double> exposure_of(const Tensor<uint8_t>& grey);

}  // namespace traceflow

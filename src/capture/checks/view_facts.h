#pragma once

#include <optional>
#include <string>
#include <vector>

#include "capture/capture.h"
#include "capture/surface_points.h"

namespace traceflow {

// Measurements of one view's pixels.
struct ViewFacts {
  const View* view = nullptr;
  std::string broken;  // why a file cannot be read; the other members then have their defaults
  bool is_uniform = false;
  double mean_colour = 0;          // in [0, 1]
  std::optional<double> exposure;  // stops: mean log₂ of the luminance of pixels that are not black
  double sharpness = 0;            // variance of the Laplacian over the image's: independent of brightness
  Tensor<uint8_t> thumbnail;       // grey, H×W
  std::optional<double> masked, with_prior;   // fractions of the pixels
  std::optional<double> noise, masked_noise;  // standard deviations in 8-bit levels, of all and in the mask
  std::optional<double> with_depth;           // fraction of the pixels with a depth prior
  std::optional<double>
      depth_error;  // median relative error of the depth prior at the points outside the mask
  std::optional<double> depth_scale;  // median of the prior's depth over the points' there
  std::optional<double> prior_angle;  // degrees: mean angle to planes through the points, outside the mask
  // For each point of the tracks whether the view sees it on the mask or beside it; empty without a mask or
  // tracks, and for test views.
  std::vector<uint8_t> track_on_mask;
};

// Decodes the view, without the cache.
ViewFacts measure_view(const Capture& capture, const View& view, const SurfacePoints& surface);

// For tests and for code that already has the pixels.
std::optional<double> exposure_of(const Tensor<uint8_t>& grey);

}  // namespace traceflow

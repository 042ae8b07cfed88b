#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "capture/capture.h"

namespace traceflow {

// What `traceflow inspect` tells about a capture (docs/inspect.md).
struct Inspection {
  struct Split {
    int64_t views = 0, masks = 0, normal_priors = 0, truth_normals = 0, truth_depths = 0;
    int64_t times = 0;  // different ones
    double first_time = 0, last_time = 0;
  };
  // Over some views that were decoded, spread evenly. Shares are of pixels.
  struct Pixels {
    int64_t views = 0;
    double mean_colour = 0;  // in [0, 1]
    double masked = 0;
    double with_prior = 0;
  };

  Split train, test;
  std::map<std::pair<int, int>, int64_t> sizes;  // width, height → views
  std::string image_folder;
  int box_factor = 1;
  int64_t resampled_views = 0;  // with distortion or skew
  double largest_zoom = 1;
  Vec3<double> camera_low{0}, camera_high{0};  // box of the training cameras, scene units
  double camera_turn_degrees = 0;              // largest angle between the axes of two training cameras
  double field_of_view_degrees = 0;            // horizontal, of the first training camera
  Vec3<double> points_low{0}, points_high{0};
  Pixels pixels;
  std::vector<std::string> missing;   // what the capture could have and does not
  std::vector<std::string> warnings;  // the capture's, and what its pixels show
};

// Decodes up to `views_to_decode` views of each split; files that cannot be read become warnings.
Inspection inspect(const Capture& capture, int64_t views_to_decode = 32);

}  // namespace traceflow

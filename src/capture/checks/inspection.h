#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "capture/capture.h"

namespace traceflow {

// The results of `traceflow inspect` (docs/inspect.md).
struct Inspection {
  struct Split {
    int64_t views = 0, masks = 0, normal_priors = 0, depth_priors = 0, truth_normals = 0, truth_depths = 0;
    int64_t times = 0;  // number of different times
    double first_time = 0, last_time = 0;
  };
  // Statistics of the decoded views. Shares are of pixels.
  struct Pixels {
    int64_t views = 0;
    double mean_colour = 0;  // in [0, 1]
    double masked = 0;
    double with_prior = 0;
    // Standard deviations in 8-bit levels, root mean square over the views; 0: unknown.
    double noise = 0, masked_noise = 0;
    double prior_angle =
        0;  // degrees, median over the views, of the angle to planes through the points; 0: unknown
    double with_depth = 0;
    // Of depth priors against the points: the median error, and the standard deviation of the views' scale;
    // relative, 0: unknown.
    double depth_error = 0, depth_drift = 0;
  };
  // Visibility of a sample of the points in the training views. Shares are of points.
  struct Sight {
    double in_view = 0;  // in the image of one view: median over the views
    double unseen = 0;   // in the image of no view
    double behind = 0;   // behind every camera
  };
  // How the point tracks agree with the cameras. Places of a point in two views a fixed number of views apart
  // are compared.
  struct Tracks {
    int64_t points = 0;
    double views = 0;      // that see a point, in the mean
    int64_t compared = 0;  // pairs of places off the masks
    // Shares of the pairs that agree or lie on masks, and of those off the masks that agree; none where there
    // are too few.
    std::optional<double> consistent, agreeing;
  };

  Split train, test;
  std::map<std::pair<int, int>, int64_t> sizes;  // width, height → views
  std::string image_folder;
  int box_factor = 1;
  int64_t resampled_views = 0;  // with distortion or skew
  double largest_zoom = 1;
  int64_t decoded_bytes = 0;                   // of all views, in their cached form
  Vec3<double> camera_low{0}, camera_high{0};  // box around the training cameras, scene units
  double camera_turn_degrees = 0;              // largest angle between the axes of two training cameras
  double field_of_view_degrees = 0;            // horizontal, of the first training camera
  Vec3<double> points_low{0}, points_high{0};
  Sight sight;
  Pixels pixels;
  Tracks tracks;
  std::vector<std::string> missing;  // optional parts that the capture does not have
  std::vector<Finding> findings;     // from loading and from all checks; problems first
};

// quick: decodes up to 32 evenly spaced views of each split and skips the comparison of neighbours in time.
// Files that cannot be read become findings.
Inspection inspect(const Capture& capture, bool quick = false);

}  // namespace traceflow

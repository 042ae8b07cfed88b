#pragma once

#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "base/work.h"
#include "math/camera.h"

namespace traceflow::prepare {

// A depth map and its camera.
struct DepthView {
  Camera<double> camera;
  Tensor<float> depth;  // H×W, camera z at pixels' centres; unknown where not positive or not finite
};

// A point on a surface that several depth maps show.
struct DepthPoint {
  struct Sighting {
    int64_t view = 0;
    Vec2<double> at{0};  // pixels
  };

  Vec3<double> position{0};  // in world
  double error = 0;          // pixels, as in agreeing_points
  std::vector<Sighting> seen;
};

struct AgreeingPoints {
  std::vector<DepthPoint> points;
  int64_t sampled = 0;   // pixels with a depth that were tried
  int64_t agreeing = 0;  // those that gave a point, of which at most `most` are kept
};

// Back-projects pixels on a coarse grid of all views, which are in time order, and keeps those that at least
// two others of the views 1, 2, 4, … before and after show too, in which more of these show the point than
// see through its place, and whose rays differ by at least 1°: where they differ less, as in the sky, the
// depth is a guess. A view shows a point if its depth there, at most 3 % off, back-projected into the first
// view misses the pixel by at most `largest_error` pixels. A point's error is the mean of these distances,
// its position that of the back-projections. At most `most` points, evenly over the views.
AgreeingPoints agreeing_points(const std::vector<DepthView>& views, double largest_error, int64_t most,
                               const Work& work);

}  // namespace traceflow::prepare

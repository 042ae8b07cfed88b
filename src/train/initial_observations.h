#pragma once

#include <memory>
#include <span>
#include <vector>

#include "capture/capture.h"
#include "scene/surfels.h"

namespace traceflow {

// What the earliest photographs show of each of N surfels, while the scene is still where its points are. A
// surfel counts as seen in a photograph if no other surfel is clearly in front of it. A surfel seen in none
// takes the values of its nearest seen neighbour: the back of an object counts as its front, and the wall
// behind an object as the wall beside it.
struct InitialObservations {
  Tensor<float> colour;      // N×3, the median of its colours, robust to outliers
  std::vector<int> outside;  // sightings outside the masks minus those inside. < 0: on the moving object, 0:
                             // no photograph with a mask shows it
  std::vector<uint8_t> any;  // 0: nothing is known, only if no surfel is seen at all
};

// The points (P×3, scene) that at least one view sees at any time, in their order. A view sees a point that
// projects into its image, or beside it by at most a tenth of its longer side, and that is more than
// near_plane in front of its camera. Occlusion is ignored. The margin covers what a camera beside the
// training cameras sees in addition; without it, its images have holes at the border.
Tensor<float> points_in_view(const Tensor<float>& points, const std::vector<View>& views, float near_plane);

// A training view with its pixels.
struct Photograph {
  Camera<float> camera;
  std::shared_ptr<const ViewImages> images;
};
// The eight earliest by time, or all if there are fewer.
std::vector<Photograph> earliest_photographs(const Capture& capture);

// `surfels` in their initial state: as wide as the distance to their neighbours.
InitialObservations observe(const Surfels& surfels, std::span<const Photograph> photographs);

}  // namespace traceflow

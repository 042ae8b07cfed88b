#pragma once

#include <memory>
#include <span>
#include <vector>

#include "capture/capture.h"
#include "scene/surfels.h"

namespace traceflow {

// What the earliest photographs show of each of N surfels, while the scene still stands as its points do.
// A surfel counts as seen in a photograph where no other one stands clearly before it; one that is seen in
// none takes over what its nearest seen neighbour has: the back of an object belongs to its front, and the
// wall behind an object to the wall beside it.
struct InitialObservations {
  Tensor<float> colour;      // N×3, the median of its colours: it forgives the odd wrong one
  std::vector<int> outside;  // sightings outside the masks less those inside: < 0 on the moving object,
                             // 0 where no photograph with a mask shows it
  std::vector<uint8_t> any;  // 0 where nothing is known, which is only when no surfel is seen at all
};

// Those of the points (P×3, scene) that some view sees at whatever time, in their order: what falls into its
// image, or beside it by at most a tenth of its longer side, and more than near_plane before its camera.
// Nothing is asked of what stands before them. The margin is what a camera beside those of training sees more
// than they: without it, its pictures end in holes.
Tensor<float> points_in_view(const Tensor<float>& points, const std::vector<View>& views, float near_plane);

// A training view with its pixels.
struct Photograph {
  Camera<float> camera;
  std::shared_ptr<const ViewImages> images;
};
// The eight earliest by time, or all where there are fewer.
std::vector<Photograph> earliest_photographs(const Capture& capture);

// `surfels` as they start: as wide as their neighbours are apart.
InitialObservations observe(const Surfels& surfels, std::span<const Photograph> photographs);

}  // namespace traceflow

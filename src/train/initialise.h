#pragma once

#include "base/random.h"
#include "capture/capture.h"
#include "scene/scene.h"
#include "train/options.h"

namespace traceflow {

// A scene and the parts of the capture that it was made from.
struct InitialScene {
  Scene scene;
  int64_t points = 0;          // finite points of the capture
  int64_t points_in_view = 0;  // points that at least one training view sees
  int64_t at_points = 0;       // main surfels at points of the capture; the others are at invented points
};

// Whether a training view has a mask of the objects, from the capture or found in the video.
bool shows_objects(const Capture& capture);
// Whether the things that the capture's masks show are tracked as bodies.
bool follows_bodies(const Capture& capture, const TrainOptions& options);

// The scene that training starts from (method §7.8). Main surfels are at the capture's points that at least
// one training view sees, or, if there are none, at random points that several views see. Environment surfels
// (or a map) surround all points, and fields are zero. No set starts larger than its max_surfels. Throws
// InputError when there are no points and no region that several views see.
InitialScene initial_scene(const Capture& capture, const TrainOptions& options, Random& random);

// The points (P×3, or empty) whose coordinates are all finite, in their order.
Tensor<float> finite_points(const Tensor<float>& points);

// The logarithm of the distance of each point (P×3) to its neighbours: the root mean square over the nearest
// three.
Tensor<float> log_spacing(const Tensor<float>& points);

// Grey surfels at the points (P×3), as wide as the distance to their neighbours.
Surfels surfels_at_points(const Tensor<float>& points, const InitialOptions& options, Random& random);
// Surfels drawn uniformly in the cells of a box `environment_box` times as large as that around the points
// and the cameras. At most `limit` surfels, spread over all cells.
Surfels surfels_around(const Tensor<float>& points, const std::vector<View>& views, int64_t limit,
                       const InitialOptions& options, Random& random);

// Environment surfels at the capture's points outside its masks, with the colours of the photographs, because
// the surroundings that the camera sees are also what the mirror reflects. At most `limit` surfels.
Surfels surroundings_at_points(const Capture& capture, const Tensor<float>& points, int64_t limit,
                               const InitialOptions& options, Random& random);

// Half the diagonal of the box around the points, without the outermost half per cent on either side of each
// axis; 1 if there are none.
float half_diagonal(const Tensor<float>& points);

// The radius of the ball around the points' median that contains nine tenths of them, in scene units.
float cloud_radius(const Tensor<float>& points);

}  // namespace traceflow

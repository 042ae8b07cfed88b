#pragma once

#include "base/random.h"
#include "capture/capture.h"
#include "scene/scene.h"
#include "train/options.h"

namespace traceflow {

// A scene and what of the capture it was made of.
struct InitialScene {
  Scene scene;
  int64_t points = 0;          // of the capture, finite
  int64_t points_in_view = 0;  // that some training view sees
  int64_t at_points = 0;       // main surfels that stand at points; those behind them at points made up
};

// Whether a training view has a mask of the objects, be it the capture's or one that was found.
bool shows_objects(const Capture& capture);
// Whether what the capture's masks show is followed as bodies.
bool follows_bodies(const Capture& capture, const TrainOptions& options);

// The scene that training starts from (method §7.8): main surfels at those of the capture's points that some
// training view sees, or, where there are none, at random ones in the views' common sight; environment
// surfels (or a map) around all of the points, fields at zero. No set starts larger than its max_surfels.
// Throws InputError when there is no such place either.
InitialScene initial_scene(const Capture& capture, const TrainOptions& options, Random& random);

// Those of the points (P×3, or empty) whose coordinates are all finite, in their order.
Tensor<float> finite_points(const Tensor<float>& points);

// The logarithm of how far each of the points (P×3) is from its neighbours: the root mean square distance of
// three.
Tensor<float> log_spacing(const Tensor<float>& points);

// Its parts. Grey surfels at the given points (P×3), as wide as their neighbours are apart.
Surfels surfels_at_points(const Tensor<float>& points, const InitialOptions& options, Random& random);
// Surfels drawn uniformly in cells of the box around the points and the cameras, `environment_box` times as
// large. At most `limit` of them, spread over all cells.
Surfels surfels_around(const Tensor<float>& points, const std::vector<View>& views, int64_t limit,
                       const InitialOptions& options, Random& random);

// Environment surfels at those of the capture's points that lie outside its masks, coloured as the
// photographs show them: the surroundings that the camera sees are also what the mirror shows. At most
// `limit` of them.
Surfels surroundings_at_points(const Capture& capture, const Tensor<float>& points, int64_t limit,
                               const InitialOptions& options, Random& random);

// Half the diagonal of the box around points but the outermost half per cent on either side; 1 where there
// are none.
float half_diagonal(const Tensor<float>& points);

// Radius of the ball around the points' median that holds nine tenths of them, in scene units.
float cloud_radius(const Tensor<float>& points);

}  // namespace traceflow

#pragma once

#include <cstdint>
#include <vector>

#include "capture/point_tracks.h"
#include "track/body_surface.h"
#include "track/normal_equations.h"

// Reprojection errors of tracked points: how a body has moved from one time to another, by where the same
// points of it are seen.
namespace traceflow {

// A point of a body at rest, and where the view of another time shows it.
struct TrackedPoint {
  SurfacePoint rest;
  Vec2<float> seen{0};  // pixels
};

// The points that tracks show in two views (indices of training views), on the surface as drawn at the key of
// the first. to: of the second view.
std::vector<TrackedPoint> tracked_points(const PointTracks& tracks, int64_t from_view, int64_t to_view,
                                         const BodySurface& surface, const Motion& motion, int64_t from_key,
                                         const Camera<float>& to);

// What tracks say of the view of the time whose poses are sought.
struct Reprojection {
  Camera<float> camera;
  std::vector<TrackedPoint> points;
  double weight = 1;  // of a point's cost
};

// What tracks decide of a body: its turns, projected, and whether its shift too.
struct TrackedPart {
  Mat3<double> turns{0};
  bool shifts = false;
};

// The robust cost (Geman–McClure) of the errors with bodies as they stand at a key. Adds to `equations`, six
// numbers a body (ω about its pivot, then its shift), unless it is null. Its b is the cost's derivative,
// negative.
double reproject(const Reprojection& reprojection, const Motion& motion, int64_t key,
                 const std::vector<TrackedPart>& parts, NormalEquations* equations);

}  // namespace traceflow

#pragma once

#include <cstdint>
#include <vector>

#include "capture/point_tracks.h"
#include "track/body_surface.h"
#include "track/normal_equations.h"

// Reprojection errors of tracked points: they show how a body has moved between two keys.
namespace traceflow {

// A point of a body at rest, and its place in another view.
struct TrackedPoint {
  SurfacePoint rest;
  Vec2<float> seen{0};  // pixels
};

// The points that tracks show in two views (indices of training views), on the surface rendered at the key of
// the first. to: camera of the second view.
std::vector<TrackedPoint> tracked_points(const PointTracks& tracks, int64_t from_view, int64_t to_view,
                                         const BodySurface& surface, const Motion& motion, int64_t from_key,
                                         const Camera<float>& to);

// The tracked points in a view of the key whose poses are solved.
struct Reprojection {
  Camera<float> camera;
  std::vector<TrackedPoint> points;
  double weight = 1;  // of a point's cost
};

// What tracks determine of a body: the projection onto its rotations, and whether they determine its
// translation.
struct TrackedPart {
  Mat3<double> turns{0};
  bool shifts = false;
};

// The robust cost (Geman–McClure) of the errors for the bodies at a key. Adds to `equations` unless it is
// null: six numbers per body (ω about its pivot, then its translation). b gets the negative derivative of the
// cost.
double reproject(const Reprojection& reprojection, const Motion& motion, int64_t key,
                 const std::vector<TrackedPart>& parts, NormalEquations* equations);

}  // namespace traceflow

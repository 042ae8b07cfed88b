#pragma once

#include "mesh/mesh.h"

namespace traceflow::mesh {

// Points of a surface with their unit normals, and, if they are of a mesh, the triangles that they are from.
struct SurfaceSamples {
  Tensor<float> points;   // N×3
  Tensor<float> normals;  // N×3, unit
  Tensor<float> corners;  // N×3×3, the corners of each point's triangle; empty: the points are all there is

  int64_t count() const { return points.empty() ? 0 : points.dim(0); }
};

// `count` points spread evenly over a mesh's area, the same for the same seed. Normals are those of the
// vertices, interpolated. Throws InternalError for a mesh without area.
SurfaceSamples sample_surface(const TriangleMesh& mesh, int64_t count, uint64_t seed = 0);

// How far a surface is from the true one. Lengths are in the units of the two.
struct SurfaceError {
  double accuracy = 0;          // mean distance of the found surface's points from the true surface
  double completeness = 0;      // mean distance of the true surface's points from the found one
  double normal_error_deg = 0;  // mean angle between a found point's normal and that of the true surface

  // The Chamfer distance as the mean of both directions.
  double chamfer() const { return (accuracy + completeness) / 2; }
};

// Distances are to the nearest of the other surface's triangles, among those of the nearest samples, so that
// they do not depend on how dense these are; to the nearest point where there are no triangles. Both must
// have points.
SurfaceError compare_surfaces(const SurfaceSamples& found, const SurfaceSamples& truth);

}  // namespace traceflow::mesh

#pragma once

#include "base/tensor.h"

namespace traceflow::mesh {

// A surface of triangles. Lengths and axes are those of what it was made from; fuse_views gives those of the
// capture. All tensors are on the host.
struct TriangleMesh {
  Tensor<float> vertices;     // N×3
  Tensor<float> normals;      // N×3, unit, to the outside
  Tensor<float> colours;      // N×3, sRGB, 0 to 1
  Tensor<int32_t> triangles;  // M×3, vertices in counter-clockwise order seen from outside

  int64_t vertex_count() const { return vertices.empty() ? 0 : vertices.dim(0); }
  int64_t triangle_count() const { return triangles.empty() ? 0 : triangles.dim(0); }
};

// The mesh without its small components. Of the components, which share no vertex with each other, those
// stay that have at least min_triangles triangles and as many as the keep-th largest; keep = 0 sets no such
// limit. Vertices of no triangle are removed. The order of what stays is kept.
TriangleMesh without_small_components(const TriangleMesh& mesh, int64_t keep, int64_t min_triangles);

}  // namespace traceflow::mesh

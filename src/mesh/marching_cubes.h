#pragma once

#include "mesh/block_grid.h"
#include "mesh/mesh.h"

namespace traceflow::mesh {

// The surface where the distance in a grid of voxels of side `voxel` is zero, by marching cubes. A cell that
// has a corner without observation yields no triangle, nor does one that has an edge along which the distance
// changes by a truncation or more: there the space before one surface meets the space behind another.
// Triangles share their vertices. Normals are the gradient of the distance. The order of vertices and
// triangles follows the blocks' places. Throws InputError if the vertices cannot be counted in 31 bits.
TriangleMesh zero_surface(const BlockGrid& grid, float voxel);

}  // namespace traceflow::mesh

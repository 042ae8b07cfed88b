#pragma once

#include <cstdint>

#include "ops/raster/cuda/stages.h"
#include "ops/raster/cuda/warp.h"
#include "ops/raster/raster_footprint.h"

// Which tiles surfels reach, found by the lanes of a warp, a surfel each, the large ones together. The
// kernels that count tiles and that list them walk by the same functions, and so find the same ones.
namespace traceflow::raster::cuda_stage {

// What a lane brings. May be extended by what visit() below wants to know.
struct BoundedSurfel {
  Bounds bounds;  // empty where the lane has no surfel
  uint32_t surfel = 0;
};

struct TileGrid {
  int columns;
  float rho_per_pixel2;

  __device__ int tile(int column, int row) const { return row * columns + column; }
  __device__ bool is_reached(const Splat& splat, int column, int row) const {
    const float x = static_cast<float>(column * tile_edge) + 0.5F;
    const float y = static_cast<float>(row * tile_edge) + 0.5F;
    return reaches(splat, x, y, x + (tile_edge - 1), y + (tile_edge - 1), rho_per_pixel2);
  }
};

// A lane alone.
template <class Surfel, class Visit>
__device__ int walk_alone(const TileGrid& grid, const Splat* splats, const Surfel& mine, const Visit& visit) {
  int found = 0;
  for (int row = mine.bounds.tile_y0; row < mine.bounds.tile_y1; ++row) {
    for (int column = mine.bounds.tile_x0; column < mine.bounds.tile_x1; ++column) {
      if (grid.is_reached(splats[mine.surfel], column, row)) visit(mine, grid.tile(column, row), found++);
    }
  }
  return found;
}

// All lanes of a warp for the same surfel.
template <class Surfel, class Visit>
__device__ int walk_together(const TileGrid& grid, const Splat* splats, const Surfel& shared,
                             const Visit& visit) {
  const Splat& splat = splats[shared.surfel];
  const int lane = lane_of_thread();
  const unsigned lanes_before = (1U << lane) - 1;
  const int tiles = static_cast<int>(shared.bounds.tiles());
  const int columns = shared.bounds.tile_x1 - shared.bounds.tile_x0;
  int found = 0;
  for (int first = 0; first < tiles; first += cuda::warp_lanes) {
    const int i = first + lane;
    const int column = shared.bounds.tile_x0 + i % columns;
    const int row = shared.bounds.tile_y0 + i / columns;
    const bool is_reached = i < tiles && grid.is_reached(splat, column, row);
    const unsigned lanes = __ballot_sync(cuda::full_warp, is_reached);
    if (is_reached) visit(shared, grid.tile(column, row), found + __popc(lanes & lanes_before));
    found += __popc(lanes);
  }
  return found;
}

// How many tiles a lane's surfel reaches; it is shared by the number of tiles in its bounds. visit(surfel,
// tile, k) is called for the k-th of them, row by row; for a surfel that the warp shares by any of its lanes.
// All lanes of the warp take part, those without a surfel too.
template <class Surfel, class Visit>
__device__ int for_each_reached(const TileGrid& grid, const Splat* splats, const Surfel& mine,
                                const Visit& visit) {
  const bool is_shared = mine.bounds.tiles() > tiles_of_one_lane;
  int found = is_shared ? 0 : walk_alone(grid, splats, mine, visit);
  for_each_shared(is_shared, mine, [&](int owner, const Surfel& shared) {
    const int of_owner = walk_together(grid, splats, shared, visit);
    if (lane_of_thread() == owner) found = of_owner;
  });
  return found;
}

}  // namespace traceflow::raster::cuda_stage

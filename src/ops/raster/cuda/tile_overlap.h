#pragma once

#include <cstdint>

#include "ops/raster/cuda/stages.h"
#include "ops/raster/cuda/warp.h"
#include "ops/raster/raster_footprint.h"

// Finds the tiles that surfels cover, with one surfel per lane of a warp; the whole warp shares large
// surfels. The kernels that count tiles and those that list them use the same functions, so they find the
// same tiles.
namespace traceflow::raster::cuda_stage {

// The input of a lane. Can be derived from to pass more data to visit() below.
struct BoundedSurfel {
  Bounds bounds;  // empty if the lane has no surfel
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

// For one lane alone.
template <class Surfel, class Visit>
__device__ int visit_tiles_alone(const TileGrid& grid, const Splat* splats, const Surfel& mine,
                                 const Visit& visit) {
  int found = 0;
  for (int row = mine.bounds.tile_y0; row < mine.bounds.tile_y1; ++row) {
    for (int column = mine.bounds.tile_x0; column < mine.bounds.tile_x1; ++column) {
      if (grid.is_reached(splats[mine.surfel], column, row)) visit(mine, grid.tile(column, row), found++);
    }
  }
  return found;
}

// For all lanes of a warp, with the same surfel.
template <class Surfel, class Visit>
__device__ int visit_tiles_together(const TileGrid& grid, const Splat* splats, const Surfel& shared,
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

// Returns how many tiles the lane's surfel covers. The warp shares a surfel if its bounds contain more than
// tiles_of_one_lane tiles. Calls visit(surfel, tile, k) for the k-th covered tile, row by row; for a shared
// surfel, any lane may make the call. All lanes of the warp take part, also those without a surfel.
template <class Surfel, class Visit>
__device__ int for_each_reached(const TileGrid& grid, const Splat* splats, const Surfel& mine,
                                const Visit& visit) {
  const bool is_shared = mine.bounds.tiles() > tiles_of_one_lane;
  int found = is_shared ? 0 : visit_tiles_alone(grid, splats, mine, visit);
  for_each_shared(is_shared, mine, [&](int owner, const Surfel& shared) {
    const int of_owner = visit_tiles_together(grid, splats, shared, visit);
    if (lane_of_thread() == owner) found = of_owner;
  });
  return found;
}

}  // namespace traceflow::raster::cuda_stage

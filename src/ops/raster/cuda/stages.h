#pragma once

#include "ops/raster/raster_kernels.h"

// The stages of the fast path on the CUDA device, where they are not the CPU's own (project_surfels() and
// project_surfels_backward() are). A block of threads is a tile, a thread a pixel; a warp holds 8×4 pixels,
// so that it can pass over the splats that reach none of them.
namespace traceflow::raster::cuda_stage {

// Where a thread has a surfel, one in more tiles is shared among the lanes of the warp.
inline constexpr uint32_t tiles_of_one_lane = 32;

// Fills entry_begin, tile_begin and entries. The host waits once, for the number of entries.
TRACEFLOW_WITH_CUDA void bin(SortOrder order, Saved& saved);
TRACEFLOW_WITH_CUDA void blend(const Options& options, Output& output, Saved& saved);
// The same bytes every time for sort = centre; for sort = hit only where cuda::deterministic() is set,
// slowly.
TRACEFLOW_WITH_CUDA void blend_backward(const Options& options, const Saved& saved,
                                        const OutputGradient& grad_output);
// Of surfels with more entries than tiles_of_one_lane: adds up the scratch.gradients of those that were
// blended, in their order, into the first.
TRACEFLOW_WITH_CUDA void add_tiles(const Saved& saved);
// Sets the flag of every surfel, 1 where an entry was blended.
TRACEFLOW_WITH_CUDA void visible(const Saved& saved, Tensor<uint8_t>& flags);

}  // namespace traceflow::raster::cuda_stage

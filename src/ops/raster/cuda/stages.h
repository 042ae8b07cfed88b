#pragma once

#include "ops/raster/raster_kernels.h"

// The stages of the fast path on the CUDA device, except project_surfels() and project_surfels_backward(),
// which share their code with the CPU. A thread block is a tile and a thread a pixel. A warp has 8×4 pixels,
// so that it can skip the splats that cover none of them.
namespace traceflow::raster::cuda_stage {

// In kernels with one surfel per thread, the warp shares surfels that are in more tiles than this.
inline constexpr uint32_t tiles_of_one_lane = 32;

// Sets entry_begin, tile_begin and entries. The host waits once, for the number of entries.
TRACEFLOW_WITH_CUDA void bin(SortOrder order, Saved& saved);
TRACEFLOW_WITH_CUDA void blend(const Options& options, Output& output, Saved& saved);
// The result is bitwise reproducible for sort = centre. For sort = hit it is so only with
// cuda::deterministic(), which is slow.
TRACEFLOW_WITH_CUDA void blend_backward(const Options& options, const Saved& saved,
                                        const OutputGradient& grad_output);
// For surfels with more entries than tiles_of_one_lane: adds up scratch.gradients of the blended entries, in
// order, into the first entry.
TRACEFLOW_WITH_CUDA void add_tiles(const Saved& saved);
// Sets the flag of every surfel: 1 if an entry was blended.
TRACEFLOW_WITH_CUDA void visible(const Saved& saved, Tensor<uint8_t>& flags);

}  // namespace traceflow::raster::cuda_stage

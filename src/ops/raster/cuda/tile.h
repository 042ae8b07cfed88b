#pragma once

#include "base/kernel.h"
#include "ops/raster/cuda/stages.h"
#include "ops/raster/raster_footprint.h"

// Shared definitions of the kernels that process a tile: the pixel of each thread, and a batch of splats in
// shared memory with the warps that each splat may cover.
namespace traceflow::raster::cuda_stage {

inline constexpr int warps_per_tile = pixels_per_tile / cuda::warp_lanes;
inline constexpr int warp_columns = 8;  // of the pixels of a warp
inline constexpr int warp_rows = cuda::warp_lanes / warp_columns;

// A splat in shared memory. Its size is an odd number of quads, so that lanes that read different splats use
// different banks.
struct BatchSplat : Splat {
  float4 apart;
};
static_assert(sizeof(BatchSplat) / sizeof(float4) % 2 == 1);

// The addresses of what forward saves.
struct SavedView {
  int width, height, tile_columns;
  float rho_per_pixel2;
  const Splat* splats;
  const uint32_t* tile_begin;
  const TileEntry* entries;
  uint16_t* touched;
};

inline SavedView view_of(const Saved& saved, uint16_t* touched) {
  return {saved.width,          saved.height,
          saved.tile_columns,   saved.rho_per_pixel2,
          saved.splats.data(),  saved.tile_begin.data(),
          saved.entries.data(), touched};
}

// The pixel of a thread.
struct TilePixel {
  int x, y;
  bool in_image;
  int64_t index;
  int warp, lane;
  float warp_x, warp_y;  // centre of the warp's first pixel
  float rho_per_pixel2;

  __device__ TilePixel(const SavedView& saved, int tile) {
    const int thread = static_cast<int>(threadIdx.x);
    rho_per_pixel2 = saved.rho_per_pixel2;
    warp = thread / cuda::warp_lanes;
    lane = thread % cuda::warp_lanes;
    const int first_x = tile % saved.tile_columns * tile_edge + warp % 2 * warp_columns;
    const int first_y = tile / saved.tile_columns * tile_edge + warp / 2 * warp_rows;
    x = first_x + lane % warp_columns;
    y = first_y + lane / warp_columns;
    in_image = x < saved.width && y < saved.height;
    index = int64_t{y} * saved.width + x;
    warp_x = static_cast<float>(first_x) + 0.5F;
    warp_y = static_cast<float>(first_y) + 0.5F;
  }
  __device__ float centre_x() const { return static_cast<float>(x) + 0.5F; }
  __device__ float centre_y() const { return static_cast<float>(y) + 0.5F; }
  __device__ PixelFootprint footprint_of(const Splat& splat) const {
    return footprint(splat, centre_x(), centre_y(), rho_per_pixel2);
  }
  __device__ bool reached_by(const Splat& splat) const {
    return reaches(splat, warp_x, warp_y, warp_x + (warp_columns - 1), warp_y + (warp_rows - 1),
                   rho_per_pixel2);
  }
};

// Copies the splats of `count` entries. All threads of the block take part, eight per splat.
__device__ inline void load_batch(const SavedView& saved, uint32_t first_entry, int count,
                                  BatchSplat* batch) {
  constexpr int quads = sizeof(Splat) / sizeof(float4);
  for (int i = static_cast<int>(threadIdx.x); i < count * quads; i += pixels_per_tile) {
    const int k = i / quads, quad = i % quads;
    const Splat& from = saved.splats[saved.entries[first_entry + static_cast<uint32_t>(k)].surfel];
    reinterpret_cast<float4*>(batch + k)[quad] = __ldg(reinterpret_cast<const float4*>(&from) + quad);
  }
}

// Bit k is set if splat first + k of the batch may cover a pixel of the warp.
__device__ inline unsigned reached_splats(const TilePixel& pixel, const BatchSplat* batch, int first,
                                          int count) {
  const int mine = first + pixel.lane;
  return __ballot_sync(cuda::full_warp, mine < count && pixel.reached_by(batch[mine]));
}

// The bits of `touched` for the lanes of a warp that blended a splat: those of its two 4×4 blocks.
__device__ inline unsigned touched_bits(int warp, unsigned lanes) {
  constexpr unsigned left_lanes = 0x0f0f0f0fU;
  const int block = warp / 2 * blocks_per_row + warp % 2 * (warp_columns / block_edge);
  unsigned bits = 0;
  if ((lanes & left_lanes) != 0) bits |= 1U << block;
  if ((lanes & ~left_lanes) != 0) bits |= 2U << block;
  return bits;
}

// Sets the bits of a splat's blocks. Atomic, because other warps set theirs at the same time.
__device__ inline void add_touched(uint16_t* touched, uint32_t entry, unsigned bits) {
  auto* const words = reinterpret_cast<unsigned*>(touched);
  atomicOr(words + entry / 2, bits << (entry % 2 * 16));
}

// sort = hit: calls f(place, splat, footprint) for the hits of a pixel in the order of their own depth, ties
// in list order, until it returns false. Each pass over the list finds the next few hits.
template <class F>
__device__ void for_each_hit(const SavedView& saved, const TilePixel& pixel, uint32_t begin, uint32_t end,
                             F&& f) {
  constexpr int per_pass = 8;
  float depth[per_pass];
  uint32_t place[per_pass];
  const auto footprint_at = [&](uint32_t k, const Splat*& splat) {
    splat = saved.splats + saved.entries[begin + k].surfel;
    return pixel.footprint_of(*splat);
  };
  bool is_first = true;
  float last_depth = 0;
  uint32_t last_place = 0;
  for (;;) {
    int found = 0;
    for (uint32_t k = 0; k < end - begin; ++k) {
      const Splat* splat = nullptr;
      const PixelFootprint at = footprint_at(k, splat);
      if (!at.inside) continue;
      const float z = at.z(*splat);
      const bool is_next = is_first || z > last_depth || (z == last_depth && k > last_place);
      if (!is_next || (found == per_pass && !(z < depth[per_pass - 1]))) continue;
      int i = found < per_pass ? found++ : per_pass - 1;
      for (; i > 0 && z < depth[i - 1]; --i) {
        depth[i] = depth[i - 1];
        place[i] = place[i - 1];
      }
      depth[i] = z;
      place[i] = k;
    }
    for (int i = 0; i < found; ++i) {
      const Splat* splat = nullptr;
      const PixelFootprint at = footprint_at(place[i], splat);
      if (!f(place[i], *splat, at)) return;
    }
    if (found < per_pass) return;
    is_first = false;
    last_depth = depth[per_pass - 1];
    last_place = place[per_pass - 1];
  }
}

}  // namespace traceflow::raster::cuda_stage

#include "ops/raster/cuda/stages.h"
#include "ops/raster/cuda/warp.h"

// Sums over a surfel's tiles. A warp shares the surfels that are in many tiles.
namespace traceflow::raster::cuda_stage {
namespace {

constexpr int values = sizeof(SplatGradient) / sizeof(float);
static_assert(values <= cuda::warp_lanes);

// The range of a surfel's entries; empty if the lane has no surfel.
struct Entries {
  uint32_t begin = 0, end = 0;

  __device__ bool are_shared() const { return end - begin > tiles_of_one_lane; }
};
__device__ Entries entries_of(const uint32_t* entry_begin, int64_t i, int64_t count) {
  return i < count ? Entries{entry_begin[i], entry_begin[i + 1]} : Entries{};
}

// Calls f(first, blended) for every 32 entries, with one bit for each entry that was blended, until it
// returns false. Flags are read one round ahead. All lanes of the warp take part.
template <class F>
__device__ void for_each_blended(const uint16_t* touched, const Entries& of, const F& f) {
  const auto mark = [&](uint32_t first) {
    const uint32_t mine = first + static_cast<uint32_t>(lane_of_thread());
    return mine < of.end && touched[mine] != 0;
  };
  bool next = mark(of.begin);
  for (uint32_t first = of.begin; first < of.end; first += cuda::warp_lanes) {
    const unsigned blended = __ballot_sync(cuda::full_warp, next);
    next = mark(first + cuda::warp_lanes);
    if (!f(first, blended)) return;
  }
}

struct AddTiles {
  const uint32_t* entry_begin;
  const uint16_t* touched;
  SplatGradient* gradients;
  int64_t count;

  __device__ void operator()(int64_t thread) const {
    // Neighbouring surfels go to different warps, because neighbours of a large surfel are often large.
    const int64_t warps = int64_t{gridDim.x} * blockDim.x / cuda::warp_lanes;
    const int64_t i = thread % cuda::warp_lanes * warps + thread / cuda::warp_lanes;
    const Entries mine = entries_of(entry_begin, i, count);
    for_each_shared(mine.are_shared(), mine, [this](int, const Entries& shared) { add_up(shared); });
  }

  // One lane per value, in tile order. Reads 32 rows at a time and adds them one by one. A row that is left
  // out counts as zero and changes no sum.
  __device__ void add_up(const Entries& of) const {
    const int lane = lane_of_thread();
    float sum = 0;
    for_each_blended(touched, of, [&](uint32_t first, unsigned blended) {
      const float* const column = &gradients[first].u_x + lane;
      float row[cuda::warp_lanes];
#pragma unroll
      for (int k = 0; k < cuda::warp_lanes; ++k) {
        const bool is_read = (blended >> k & 1U) != 0 && lane < values;
        row[k] = is_read ? column[k * values] : 0.0F;
      }
#pragma unroll
      for (const float value : row) sum += value;
      return true;
    });
    if (lane < values) (&gradients[of.begin].u_x)[lane] = sum;
  }
};

// IsVisible, with one warp for each surfel that is in many tiles.
struct FindVisible {
  IsVisible alone;
  int64_t count;

  __device__ void operator()(int64_t i) const {
    const Entries mine = entries_of(alone.entry_begin, i, count);
    bool visible = !mine.are_shared() && i < count && alone.is_visible(i);
    for_each_shared(mine.are_shared(), mine, [&](int owner, const Entries& shared) {
      bool any = false;
      for_each_blended(alone.touched, shared, [&](uint32_t, unsigned blended) {
        any = blended != 0;
        return !any;
      });
      if (lane_of_thread() == owner) visible = any;
    });
    if (i < count) alone.flags[i] = visible ? 1 : 0;
  }
};

}  // namespace

void add_tiles(const Saved& saved) {
  for_each_in_whole_warps(
      "raster: add tiles", saved.count,
      AddTiles{saved.entry_begin.data(), saved.touched.data(), saved.scratch.gradients.data(), saved.count});
}

void visible(const Saved& saved, Tensor<uint8_t>& flags) {
  for_each_in_whole_warps(
      "raster: visible", saved.count,
      FindVisible{{saved.entry_begin.data(), saved.touched.data(), flags.data()}, saved.count});
}

}  // namespace traceflow::raster::cuda_stage

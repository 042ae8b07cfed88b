#include <bit>
#include <limits>
#include <string>

#include "base/kernel.h"
#include "ops/raster/cuda/stages.h"
#include "ops/raster/cuda/tile_overlap.h"
#include "ops/raster/project.h"
#include "ops/raster/project_backward.h"
#include "primitives/sort.h"
#include "primitives/sum_kernels.h"

// Builds the list of surfels of every tile. Surfels are sorted by depth once, and their entries are written
// in that order. A stable sort by tile then leaves each tile's list front to back.
namespace traceflow {

template void cuda::for_each_index(const char*, int64_t, const raster::ProjectSurfel&);
template void cuda::for_each_index(const char*, int64_t, const raster::ProjectBackwardStep&);
template void cuda::sum_each_index<CameraGradient<double>>(const char*, int64_t, const raster::CameraShareOf&,
                                                           const StoreSum<CameraGradient<double>>&);

namespace raster::cuda_stage {

// Computes how many tiles each surfel covers, and its sort key.
struct CountTiles {
  TileGrid grid;
  bool by_depth;
  const Splat* splats;
  const Bounds* bounds;
  int32_t* counts;  // N + 1
  uint32_t *keys, *surfels;
  int64_t count;

  __device__ void operator()(int64_t i) const {
    const auto surfel = static_cast<uint32_t>(i);
    const BoundedSurfel mine{i < count ? bounds[i] : Bounds{}, surfel};
    const int32_t tiles = for_each_reached(grid, splats, mine, [](const BoundedSurfel&, int, int) {});
    if (i <= count) counts[i] = tiles;
    if (i >= count) return;
    // Depths are positive, so their bits have the same order.
    keys[i] = tiles > 0 && by_depth ? std::bit_cast<uint32_t>(splats[i].z_centre) : 0;
    surfels[i] = surfel;
  }
};

// The counts in depth order.
struct GatherCounts {
  const uint32_t* order;
  const int32_t* counts;
  int64_t* ordered;  // N + 1
  int64_t count;

  __device__ void operator()(int64_t k) const { ordered[k] = k < count ? int64_t{counts[order[k]]} : 0; }
};

// Writes the entries of the k-th nearest surfel: its tiles, at the positions given by the prefix sum of the
// counts.
struct WriteEntries {
  TileGrid grid;
  const Splat* splats;
  const Bounds* bounds;
  const uint32_t* order;
  const int64_t* place;  // by depth order
  const int32_t* entry;  // by surfel
  uint32_t *tiles, *places;
  TileEntry* entries;
  int64_t count;

  struct PlacedSurfel : BoundedSurfel {
    uint32_t first_entry = 0;
    uint32_t first_place = 0;
  };

  __device__ PlacedSurfel nearest(int64_t k) const {
    const uint32_t surfel = order[k];
    return {{bounds[surfel], surfel}, static_cast<uint32_t>(entry[surfel]), static_cast<uint32_t>(place[k])};
  }

  __device__ void operator()(int64_t k) const {
    const PlacedSurfel mine = k < count ? nearest(k) : PlacedSurfel{};
    for_each_reached(grid, splats, mine, [&](const PlacedSurfel& of, int tile, int nth) {
      const uint32_t at = of.first_place + static_cast<uint32_t>(nth);
      tiles[at] = static_cast<uint32_t>(tile);
      places[at] = at;
      entries[at] = {of.surfel, of.first_entry + static_cast<uint32_t>(nth)};
    });
  }
};

struct SortEntries {
  const uint32_t* places;
  const TileEntry* unsorted;
  TileEntry* sorted;

  __device__ void operator()(int64_t k) const { sorted[k] = unsorted[places[k]]; }
};

// Finds the start of each tile's list: the first entry that does not belong to an earlier tile.
struct FindTiles {
  const uint32_t* tiles;  // sorted
  uint32_t entries;
  uint32_t* begin;  // tiles + 1

  __device__ void operator()(int64_t tile) const {
    uint32_t low = 0, high = entries;
    while (low < high) {
      const uint32_t middle = (low + high) / 2;
      if (tiles[middle] < tile) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    begin[tile] = low;
  }
};

namespace {

template <class T>
T* resized(Tensor<T>& tensor, int64_t size) {
  tensor.place(Device::cuda).resize({size});
  return tensor.data();
}

// Returns a tensor's last element.
int64_t read_back(const Tensor<int64_t>& tensor) {
  int64_t value = 0;
  memory::copy(Device::cpu, &value, Device::cuda, tensor.data() + tensor.size() - 1, sizeof(value));
  return value;
}

}  // namespace

void bin(SortOrder order, Saved& saved) {
  Saved::Scratch& s = saved.scratch;
  const int64_t n = saved.count;
  const TileGrid grid{saved.tile_columns, saved.rho_per_pixel2};
  int32_t* const counts = resized(s.counts, n + 1);
  uint32_t* const keys = resized(s.depth_keys, n);
  uint32_t* const surfels = resized(s.surfels, n);
  for_each_in_whole_warps("raster: count tiles", n + 1,
                          CountTiles{grid, order == SortOrder::centre, saved.splats.data(),
                                     saved.bounds.data(), counts, keys, surfels, n});
  uint32_t* ordered = surfels;
  if (order == SortOrder::centre && n > 0) {
    ordered = resized(s.surfels_sorted, n);
    cuda::sort_pairs(n, 32, keys, resized(s.depth_keys_sorted, n), surfels, ordered, s.bytes);
  }
  // By surfel: the start of its entries in surfel order.
  static_assert(sizeof(uint32_t) == sizeof(int32_t));
  auto* const entry = reinterpret_cast<int32_t*>(resized(saved.entry_begin, n + 1));
  cuda::exclusive_sum(counts, entry, n + 1, s.bytes);
  // By depth order: the positions to write them to. In 64 bits, so that an overflow is detected.
  int64_t* const place = resized(s.offsets, n + 1);
  cuda::for_each_index("raster: gather counts", n + 1, GatherCounts{ordered, counts, place, n});
  cuda::exclusive_sum(place, place, n + 1, s.bytes);
  const int64_t entries = read_back(s.offsets);
  require(entries < std::numeric_limits<int32_t>::max(), "surfels times tiles fit 31 bits",
          std::to_string(entries));

  uint32_t* const tiles = resized(s.tile_keys, entries);
  uint32_t* const tiles_sorted = resized(s.tile_keys_sorted, entries);
  uint32_t* const places = resized(s.places, entries);
  uint32_t* const places_sorted = resized(s.places_sorted, entries);
  TileEntry* const unsorted = resized(s.unsorted, entries);
  for_each_in_whole_warps("raster: write entries", n,
                          WriteEntries{grid, saved.splats.data(), saved.bounds.data(), ordered, place, entry,
                                       tiles, places, unsorted, n});
  TileEntry* const sorted = resized(saved.entries, entries);
  if (entries > 0) {
    const int bits = static_cast<int>(std::bit_width(static_cast<uint64_t>(saved.tiles())));
    cuda::sort_pairs(entries, bits, tiles, tiles_sorted, places, places_sorted, s.bytes);
    cuda::for_each_index("raster: sort entries", entries, SortEntries{places_sorted, unsorted, sorted});
  }
  uint32_t* const begin = resized(saved.tile_begin, saved.tiles() + 1);
  cuda::for_each_index("raster: find tiles", saved.tiles() + 1,
                       FindTiles{tiles_sorted, static_cast<uint32_t>(entries), begin});
}

}  // namespace raster::cuda_stage
}  // namespace traceflow

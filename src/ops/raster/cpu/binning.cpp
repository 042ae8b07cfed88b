#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "ops/raster/raster_kernels.h"

// Builds the list of surfels of every tile. Surfels are sorted once. Then fixed parts of the sorted surfels
// count their entries and write their section of every tile's list. So the lists do not depend on the number
// of threads.
namespace traceflow::raster {
namespace {

constexpr int64_t surfels_per_part = 4096;

// The upper half of a key is the depth of the centre, the lower half the index of the surfel.
uint64_t sort_key(float z, int64_t surfel) {
  return uint64_t{std::bit_cast<uint32_t>(z)} << 32 | static_cast<uint32_t>(surfel);
}
int64_t surfel_of(uint64_t key) { return static_cast<int64_t>(key & 0xffffffffU); }

// Sorts by the upper half; equal keys keep their order. The floats in it are positive, so their bits have the
// same order.
void sort_by_depth(Tensor<uint64_t>& keys, Tensor<uint64_t>& other) {
  constexpr int digit_bits = 11;
  constexpr size_t digits = size_t{1} << digit_bits;
  other.resize(keys.shape());
  std::vector<uint32_t> counts(digits);
  for (int shift = 32; shift < 64; shift += digit_bits) {
    const auto digit = [&](uint64_t key) { return static_cast<size_t>(key >> shift) & (digits - 1); };
    std::fill(counts.begin(), counts.end(), 0U);
    for (const uint64_t key : keys.values()) ++counts[digit(key)];
    if (counts[keys.empty() ? 0 : digit(keys[0])] == keys.size()) continue;
    uint32_t begin = 0;
    for (uint32_t& count : counts) begin += std::exchange(count, begin);
    for (const uint64_t key : keys.values()) other[counts[digit(key)]++] = key;
    std::swap(keys, other);
  }
}

void collect_keys(SortOrder order, const Saved& saved, Tensor<uint64_t>& keys) {
  keys.resize({saved.count});
  int64_t visible = 0;
  for (int64_t i = 0; i < saved.count; ++i) {
    if (saved.bounds[i].tiles() == 0) continue;
    keys[visible++] = sort_key(order == SortOrder::centre ? saved.splats[i].z_centre : 0, i);
  }
  keys.resize({visible});
}

void count_entries(Saved& saved) {
  saved.entry_begin.resize({saved.count + 1});
  uint64_t entries = 0;
  for (int64_t i = 0; i < saved.count; ++i) {
    saved.entry_begin[i] = static_cast<uint32_t>(entries);
    entries += static_cast<uint64_t>(saved.bounds[i].tiles());
  }
  require(entries < std::numeric_limits<uint32_t>::max(), "surfels times tiles fit 32 bits",
          std::to_string(entries));
  saved.entry_begin[saved.count] = static_cast<uint32_t>(entries);
}

// f(tile, entry) for every tile that a surfel may touch, in the order of its entries.
template <class F>
void for_each_tile(const Saved& saved, int64_t surfel, F&& f) {
  const Bounds& b = saved.bounds[surfel];
  uint32_t entry = saved.entry_begin[surfel];
  for (int64_t row = b.tile_y0; row < b.tile_y1; ++row) {
    for (int64_t column = b.tile_x0; column < b.tile_x1; ++column)
      f(row * saved.tile_columns + column, entry++);
  }
}

// Replaces counts (part × tile) by the start of each part in each tile's list.
void begin_lists(Tensor<uint32_t>& counts, Saved& saved) {
  const int64_t tiles = saved.tiles();
  saved.tile_begin.resize({tiles + 1});
  uint32_t begin = 0;
  for (int64_t tile = 0; tile < tiles; ++tile) {
    saved.tile_begin[tile] = begin;
    for (int64_t part = 0; part < counts.dim(0); ++part) begin += std::exchange(counts(part, tile), begin);
  }
  saved.tile_begin[tiles] = begin;
}

void fill_lists(Saved& saved) {
  const Tensor<uint64_t>& keys = saved.scratch.keys;
  Tensor<uint32_t>& counts = saved.scratch.tile_counts;
  counts.reset({(keys.size() + surfels_per_part - 1) / surfels_per_part, saved.tiles()});
  parallel_blocks("raster: count", keys.size(), surfels_per_part, [&](int64_t begin, int64_t end) {
    uint32_t* count = counts.row(begin / surfels_per_part);
    for (int64_t k = begin; k < end; ++k) {
      for_each_tile(saved, surfel_of(keys[k]), [&](int64_t tile, uint32_t) { ++count[tile]; });
    }
  });
  begin_lists(counts, saved);
  saved.entries.resize({saved.tile_begin[saved.tiles()]});
  parallel_blocks("raster: bin", keys.size(), surfels_per_part, [&](int64_t begin, int64_t end) {
    uint32_t* next = counts.row(begin / surfels_per_part);
    for (int64_t k = begin; k < end; ++k) {
      const auto surfel = static_cast<uint32_t>(surfel_of(keys[k]));
      for_each_tile(saved, surfel, [&](int64_t tile, uint32_t entry) {
        saved.entries[next[tile]++] = {surfel, entry};
      });
    }
  });
}

}  // namespace

void bin(SortOrder order, Saved& saved) {
  {
    const profile::Scope scope("raster: sort");
    collect_keys(order, saved, saved.scratch.keys);
    if (order == SortOrder::centre) sort_by_depth(saved.scratch.keys, saved.scratch.keys_sorted);
    count_entries(saved);
  }
  fill_lists(saved);
}

}  // namespace traceflow::raster

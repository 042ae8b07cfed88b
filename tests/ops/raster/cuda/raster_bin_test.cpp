#include <algorithm>
#include <numeric>

#include "../raster_scenes.h"
#include "ops/raster/cuda/stages.h"
#include "ops/raster/raster_footprint.h"
#include "support/device.h"

// The lists of the tiles, against those that one loop after the other writes on the host.
namespace traceflow::raster {

static bool operator==(const TileEntry& a, const TileEntry& b) {
  return a.surfel == b.surfel && a.entry == b.entry;
}

namespace {

using namespace traceflow::testing;

class TileListsOnDevice : public OnDevice, public ::testing::WithParamInterface<SortOrder> {};

// What bin() leaves, on the host.
struct Lists {
  std::vector<uint32_t> entry_begin, tile_begin;
  std::vector<TileEntry> entries;
  std::vector<Bounds> bounds;
};

template <class T>
std::vector<T> on_host(const Tensor<T>& tensor) {
  const Tensor<T> copy = tensor.on(Device::cpu);
  return {copy.data(), copy.data() + copy.size()};
}

Lists lists_of(const Saved& saved) {
  return {on_host(saved.entry_begin), on_host(saved.tile_begin), on_host(saved.entries),
          on_host(saved.bounds)};
}

// The tiles that each surfel reaches, row by row.
std::vector<std::vector<int>> reached_tiles(const Saved& saved) {
  const std::vector<Splat> splats = on_host(saved.splats);
  const std::vector<Bounds> bounds = on_host(saved.bounds);
  std::vector<std::vector<int>> tiles(bounds.size());
  for (size_t i = 0; i < bounds.size(); ++i) {
    for (int row = bounds[i].tile_y0; row < bounds[i].tile_y1; ++row) {
      for (int column = bounds[i].tile_x0; column < bounds[i].tile_x1; ++column) {
        const float x = static_cast<float>(column * tile_edge) + 0.5F;
        const float y = static_cast<float>(row * tile_edge) + 0.5F;
        if (reaches(splats[i], x, y, x + (tile_edge - 1), y + (tile_edge - 1), saved.rho_per_pixel2)) {
          tiles[i].push_back(row * saved.tile_columns + column);
        }
      }
    }
  }
  return tiles;
}

Lists plain_lists(SortOrder order, const Saved& saved) {
  const std::vector<std::vector<int>> tiles = reached_tiles(saved);
  Lists lists;
  lists.bounds = on_host(saved.bounds);
  lists.entry_begin = {0};
  for (const auto& of_surfel : tiles) {
    lists.entry_begin.push_back(lists.entry_begin.back() + static_cast<uint32_t>(of_surfel.size()));
  }
  std::vector<uint32_t> surfels(tiles.size());
  std::iota(surfels.begin(), surfels.end(), 0U);
  std::erase_if(surfels, [&](uint32_t i) { return tiles[i].empty(); });
  if (order == SortOrder::centre) {
    const std::vector<Splat> splats = on_host(saved.splats);
    std::stable_sort(surfels.begin(), surfels.end(),
                     [&](uint32_t a, uint32_t b) { return splats[a].z_centre < splats[b].z_centre; });
  }
  std::vector<std::vector<TileEntry>> of_tile(static_cast<size_t>(saved.tiles()));
  for (const uint32_t surfel : surfels) {
    uint32_t entry = lists.entry_begin[surfel];
    for (const int tile : tiles[surfel]) of_tile[static_cast<size_t>(tile)].push_back({surfel, entry++});
  }
  lists.tile_begin = {0};
  for (const auto& list : of_tile) {
    lists.entries.insert(lists.entries.end(), list.begin(), list.end());
    lists.tile_begin.push_back(static_cast<uint32_t>(lists.entries.size()));
  }
  return lists;
}

// Bins a scene on the device, and expects what the host finds.
Lists expect_plain_lists(SortOrder order, const TestScene<double>& scene) {
  const auto placed = convert_scene<float>(scene);
  Options options;
  options.sort = order;
  Saved saved;
  project_surfels(placed.surfels.on(Device::cuda), placed.camera, options, saved);
  cuda_stage::bin(order, saved);
  Lists found = lists_of(saved);
  const Lists expected = plain_lists(order, saved);
  EXPECT_EQ(found.entry_begin, expected.entry_begin);
  EXPECT_EQ(found.tile_begin, expected.tile_begin);
  EXPECT_TRUE(found.entries == expected.entries);
  return found;
}

// More bounds than one warp has lanes for, of all sizes side by side, and the last warp is not full.
TEST_P(TileListsOnDevice, HoldSurfelsOfManySizes) {
  const Lists lists = expect_plain_lists(GetParam(), scene_of_sizes(1, 48));
  std::vector<uint32_t> reached;
  for (size_t i = 0; i < lists.bounds.size(); ++i) {
    ASSERT_EQ(lists.bounds[i].tiles(), tiles_in_turn[i % tiles_in_turn.size()]) << i;
    reached.push_back(lists.entry_begin[i + 1] - lists.entry_begin[i]);
  }
  EXPECT_EQ(reached[1], 32);
  EXPECT_EQ(reached[2], 33);
  EXPECT_LT(reached[3], 32);  // along the diagonal
  EXPECT_EQ(reached[47], 112);
}

TEST_P(TileListsOnDevice, HoldAnyNumberOfSurfels) {
  for (const int64_t count : {0, 1, 31, 32, 33, 255, 256, 257}) {
    SceneOptions o;
    o.count = count;
    o.scale_max = 2;
    o.depth_min = -1;  // some are not drawn
    SCOPED_TRACE(count);
    expect_plain_lists(GetParam(), random_scene(static_cast<uint64_t>(count), 210, 150, o));
  }
}

// Warps full of surfels in thousands of tiles each.
TEST_P(TileListsOnDevice, HoldSurfelsOfWholePictures) {
  SceneOptions o;
  o.count = 40;
  o.scale_min = 1;
  o.scale_max = 10;
  const Lists lists = expect_plain_lists(GetParam(), random_scene(2, 1910, 1070, o));
  EXPECT_GT(lists.entries.size(), 100'000);
}

INSTANTIATE_TEST_SUITE_P(Orders, TileListsOnDevice, ::testing::Values(SortOrder::centre, SortOrder::hit),
                         [](const auto& order) {
                           return std::string(enum_names(order.param)[static_cast<size_t>(order.param)]);
                         });

}  // namespace
}  // namespace traceflow::raster

#include <array>
#include <bit>
#include <limits>

#include "base/random.h"
#include "ops/raster/cuda/stages.h"
#include "support/device.h"

// What a surfel's tiles add up to, against a loop over its entries on the host.
namespace traceflow::raster {
namespace {

using namespace traceflow::testing;

class SurfelSumsOnDevice : public OnDevice {};

// Around the number of tiles that a lane takes, the number that a warp reads at a time, and all of a picture
// of 1920×1080.
constexpr std::array tile_counts{1, 32, 33, 0, 31, 64, 65, 2, 130, 8160};

// Which of a surfel's entries were blended.
enum class Blended { all, some, last, none };

// What forward and backward leave of surfels in any tiles; on the host.
struct Entries {
  Tensor<uint32_t> begin;
  Tensor<uint16_t> touched;
  Tensor<SplatGradient> gradients;

  int64_t count() const { return begin.size() - 1; }
  int64_t tiles(int64_t i) const { return begin[i + 1] - begin[i]; }
};

// Every number of tiles with every kind of marks. Entries that were not blended hold no numbers.
Entries random_entries(int64_t count) {
  Random random(1);
  Entries made;
  made.begin = Tensor<uint32_t>({count + 1});
  made.begin[0] = 0;
  for (int64_t i = 0; i < count; ++i) {
    made.begin[i + 1] =
        made.begin[i] + static_cast<uint32_t>(tile_counts[static_cast<size_t>(i) % tile_counts.size()]);
  }
  const int64_t entries = made.begin[count];
  made.touched = Tensor<uint16_t>({entries + 1});
  made.touched.fill(1);  // one more than there are entries, that no surfel may take for its own
  made.gradients = Tensor<SplatGradient>({entries});
  for (int64_t i = 0; i < count; ++i) {
    const auto blended = static_cast<Blended>(i / static_cast<int64_t>(tile_counts.size()) % 4);
    for (uint32_t entry = made.begin[i]; entry < made.begin[i + 1]; ++entry) {
      const bool is_blended = blended == Blended::all || (blended == Blended::some && random.below(2) == 0) ||
                              (blended == Blended::last && entry + 1 == made.begin[i + 1]);
      made.touched[entry] = is_blended ? static_cast<uint16_t>(1U << random.below(16)) : uint16_t{0};
      float* const value = &made.gradients[entry].u_x;
      for (size_t k = 0; k < sizeof(SplatGradient) / sizeof(float); ++k) {
        value[k] = is_blended ? static_cast<float>(random.normal()) : std::numeric_limits<float>::quiet_NaN();
      }
    }
  }
  return made;
}

void place(const Entries& entries, Saved& saved) {
  saved.count = entries.count();
  saved.splats.place(Device::cuda).resize({saved.count});
  saved.entry_begin = entries.begin.on(Device::cuda);
  saved.touched = entries.touched.on(Device::cuda);
  saved.scratch.gradients = entries.gradients.on(Device::cuda);
}

SplatGradient sum_in_turn(const Entries& entries, int64_t i) {
  SplatGradient sum{};
  for (uint32_t entry = entries.begin[i]; entry < entries.begin[i + 1]; ++entry) {
    if (entries.touched[entry] == 0) continue;
    for (size_t k = 0; k < sizeof(SplatGradient) / sizeof(float); ++k) {
      (&sum.u_x)[k] += (&entries.gradients[entry].u_x)[k];
    }
  }
  return sum;
}

bool same_bytes(const SplatGradient& a, const SplatGradient& b) {
  using Bits = std::array<uint32_t, sizeof(SplatGradient) / sizeof(uint32_t)>;
  return std::bit_cast<Bits>(a) == std::bit_cast<Bits>(b);
}

// The same bytes as those of a thread that adds one tile after the other, in the first entry of the surfels
// that are in many; all other entries are left as they were.
TEST_F(SurfelSumsOnDevice, AreThoseOfTheTilesInTurn) {
  for (const int64_t count : {0, 1, 31, 32, 33, 45, 300}) {
    SCOPED_TRACE(count);
    const Entries entries = random_entries(count);
    Saved saved;
    place(entries, saved);
    cuda_stage::add_tiles(saved);
    const Tensor<SplatGradient> found = saved.scratch.gradients.on(Device::cpu);
    for (int64_t i = 0; i < count; ++i) {
      const bool is_added = entries.tiles(i) > cuda_stage::tiles_of_one_lane;
      for (uint32_t entry = entries.begin[i]; entry < entries.begin[i + 1]; ++entry) {
        const bool is_first = entry == entries.begin[i];
        const SplatGradient expected =
            is_added && is_first ? sum_in_turn(entries, i) : entries.gradients[entry];
        ASSERT_TRUE(same_bytes(found[entry], expected))
            << "surfel " << i << " of " << entries.tiles(i) << " tiles, entry " << entry - entries.begin[i];
      }
    }
  }
}

TEST_F(SurfelSumsOnDevice, SurfelsAreVisibleThatATileBlended) {
  for (const int64_t count : {0, 1, 31, 32, 33, 45, 300}) {
    SCOPED_TRACE(count);
    const Entries entries = random_entries(count);
    Saved saved;
    place(entries, saved);
    Tensor<uint8_t> flags;
    visible(saved, flags);
    ASSERT_EQ(flags.size(), count);
    const Tensor<uint8_t> found = flags.on(Device::cpu);
    for (int64_t i = 0; i < count; ++i) {
      bool any = false;
      for (uint32_t entry = entries.begin[i]; entry < entries.begin[i + 1]; ++entry) {
        any = any || entries.touched[entry] != 0;
      }
      ASSERT_EQ(found[i], any ? 1 : 0) << "surfel " << i << " of " << entries.tiles(i) << " tiles";
    }
  }
}

}  // namespace
}  // namespace traceflow::raster

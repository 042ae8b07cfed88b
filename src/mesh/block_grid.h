#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "math/types.h"

namespace traceflow::mesh {

// The side of a block, in voxels.
inline constexpr int block_side = 8;
inline constexpr int block_voxels = block_side * block_side * block_side;

// What is known in a cube of voxels. Voxel (i, j, k) of the grid is the point voxel·(i, j, k); index() gives
// its number in its block.
struct Block {
  explicit Block(const Vec3<int32_t>& at) : place(at) {}

  static int index(int x, int y, int z) { return (z * block_side + y) * block_side + x; }

  Vec3<int32_t> place;  // the first voxel is block_side·place
  // Signed distance from the surface in truncations, at most 1, positive on the side of the cameras.
  std::array<float, block_voxels> distance{};
  std::array<float, block_voxels> weight{};  // 0: not observed
  std::array<float, 3 * block_voxels> colour{};
  std::array<float, block_voxels> colour_weight{};  // 0: not observed near the surface
};

// A voxel of some block.
struct Voxel {
  const Block* block = nullptr;  // null: there is none
  int index = 0;

  bool known() const { return block != nullptr && block->weight[static_cast<size_t>(index)] > 0; }
  float distance() const { return block->distance[static_cast<size_t>(index)]; }
};

// Blocks where there are any, found by their place.
class BlockGrid {
 public:
  // The largest coordinate of a block's place.
  static constexpr int32_t most_places = (1 << 20) - 1;

  // A number for a place whose coordinates are at most most_places. Ascending numbers are ascending by z,
  // then y, then x.
  static uint64_t key_of(const Vec3<int32_t>& place);

  // Adds the blocks of these keys that are missing, in the order of the list.
  void add(const std::vector<uint64_t>& keys);
  int64_t count() const { return static_cast<int64_t>(blocks_.size()); }
  Block& operator[](int64_t i) { return *blocks_[static_cast<size_t>(i)]; }
  const Block& operator[](int64_t i) const { return *blocks_[static_cast<size_t>(i)]; }
  // The number of the block at a place; -1 if there is none.
  int32_t find(const Vec3<int32_t>& place) const;
  bool has(uint64_t key) const { return found_.contains(key); }
  // The numbers of all blocks by ascending key.
  std::vector<int32_t> by_key() const;

 private:
  std::vector<std::unique_ptr<Block>> blocks_;
  std::unordered_map<uint64_t, int32_t> found_;
};

// A block and the 26 around it.
class Neighbourhood {
 public:
  Neighbourhood(const BlockGrid& grid, const Block& middle);

  // The voxel at this offset from the middle block's first; each coordinate from -8 to 15.
  Voxel at(int x, int y, int z) const;
  // The number of the block that holds this voxel; -1 if there is none.
  int32_t block_at(int x, int y, int z) const { return number_[static_cast<size_t>(slot_of(x, y, z))]; }

 private:
  static int slot_of(int x, int y, int z) {
    return (((z + block_side) / block_side) * 3 + (y + block_side) / block_side) * 3 +
           (x + block_side) / block_side;
  }

  std::array<int32_t, 27> number_{};
  std::array<const Block*, 27> block_{};
};

}  // namespace traceflow::mesh

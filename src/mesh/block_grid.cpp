#include "mesh/block_grid.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

namespace traceflow::mesh {

uint64_t BlockGrid::key_of(const Vec3<int32_t>& place) {
  const auto part = [](int32_t v) { return static_cast<uint64_t>(v + most_places + 1); };
  return part(place.z) << 42U | part(place.y) << 21U | part(place.x);
}

void BlockGrid::add(const std::vector<uint64_t>& keys) {
  constexpr uint64_t low = (uint64_t{1} << 21U) - 1;
  const auto part = [](uint64_t v) { return static_cast<int32_t>(v & low) - most_places - 1; };
  for (const uint64_t key : keys) {
    const auto [entry, is_new] = found_.try_emplace(key, static_cast<int32_t>(blocks_.size()));
    if (!is_new) continue;
    blocks_.push_back(std::make_unique<Block>(Vec3<int32_t>(part(key), part(key >> 21U), part(key >> 42U))));
  }
}

int32_t BlockGrid::find(const Vec3<int32_t>& place) const {
  if (std::max({std::abs(place.x), std::abs(place.y), std::abs(place.z)}) > most_places) return -1;
  const auto entry = found_.find(key_of(place));
  return entry == found_.end() ? -1 : entry->second;
}

std::vector<int32_t> BlockGrid::by_key() const {
  std::vector<int32_t> order(blocks_.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](int32_t i) { return key_of((*this)[i].place); });
  return order;
}

Neighbourhood::Neighbourhood(const BlockGrid& grid, const Block& middle) {
  for (int slot = 0; slot < 27; ++slot) {
    const Vec3<int32_t> step(slot % 3 - 1, slot / 3 % 3 - 1, slot / 9 - 1);
    const int32_t number = grid.find(middle.place + step);
    number_[static_cast<size_t>(slot)] = number;
    block_[static_cast<size_t>(slot)] = number < 0 ? nullptr : &grid[number];
  }
}

Voxel Neighbourhood::at(int x, int y, int z) const {
  constexpr int inside = block_side - 1;
  return {block_[static_cast<size_t>(slot_of(x, y, z))], Block::index(x & inside, y & inside, z & inside)};
}

}  // namespace traceflow::mesh

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/device.h"

// One kernel for many pieces of memory of different sizes: most are so small that a kernel each would take
// longer to launch. Every piece, a part with a member int32_t first_block, gets its own blocks.
namespace traceflow::cuda {

// The size of kernel parameters that every supported device and toolkit allows.
inline constexpr size_t most_parameter_bytes = 4096;

// Assigns each part its first block; blocks_of(part) is the number that it needs. Returns the total.
template <class Part, class F>
int64_t assign_blocks(std::span<Part> parts, const F& blocks_of) {
  int64_t blocks = 0;
  for (Part& part : parts) {
    part.first_block = static_cast<int32_t>(blocks);
    blocks += blocks_of(part);
  }
  return blocks;
}

// The part that a block works on: the last one that begins at or before it.
template <class Part>
TRACEFLOW_HD int part_of_block(const Part* parts, int count, int block) {
  int first = 0, last = count - 1;
  while (first < last) {
    const int middle = (first + last + 1) / 2;
    if (parts[middle].first_block <= block) {
      first = middle;
    } else {
      last = middle - 1;
    }
  }
  return first;
}

}  // namespace traceflow::cuda

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/device.h"

// One kernel for many pieces of memory of different sizes, since a kernel each would cost more than most of
// them take: every piece, a part with a member int32_t first_block, gets blocks of its own.
namespace traceflow::cuda {

// Kernels take their parameters in this many bytes on every device and with every toolkit that is supported.
inline constexpr size_t most_parameter_bytes = 4096;

// Gives each part its first block; blocks_of(part) is how many it wants. Returns how many there are.
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

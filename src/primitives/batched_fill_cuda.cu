#include "base/kernel.h"
#include "primitives/batched_fill.h"
#include "primitives/multi_tensor.h"

namespace traceflow::cuda {

namespace {

constexpr int zero_threads = 256;
constexpr int stores_each = 8;

struct alignas(16) Word {
  uint32_t value[4];
};
constexpr int64_t word_bytes = sizeof(Word);
constexpr int64_t block_bytes = zero_threads * stores_each * word_bytes;

struct RangeTable {
  static constexpr int most_ranges = 160;
  int32_t ranges;
  Range range[most_ranges];
};
static_assert(sizeof(RangeTable) <= most_parameter_bytes);

__global__ void __launch_bounds__(zero_threads) fill(const __grid_constant__ RangeTable table) {
  const auto block = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  const Range& range = table.range[part_of_block(table.range, table.ranges, block)];
  const int64_t begin = (block - range.first_block) * block_bytes;
  const int64_t end = std::min(range.bytes, begin + block_bytes);
  for (int64_t at = begin + thread * word_bytes; at < end; at += zero_threads * word_bytes) {
    if (at + word_bytes <= end) {
      *reinterpret_cast<Word*>(range.begin + at) = Word{};
    } else {
      for (int64_t i = at; i < end; ++i) range.begin[i] = std::byte{0};
    }
  }
}

}  // namespace

void fill_zero(std::vector<Range>& ranges) {
  std::span<Range> left(ranges);
  while (!left.empty()) {
    const std::span<Range> some = left.first(std::min<size_t>(left.size(), RangeTable::most_ranges));
    left = left.subspan(some.size());
    const int64_t blocks =
        assign_blocks(some, [](const Range& range) { return (range.bytes + block_bytes - 1) / block_bytes; });
    RangeTable table{.ranges = static_cast<int32_t>(some.size()), .range = {}};
    std::copy(some.begin(), some.end(), table.range);
    launch("zeros", {blocks, zero_threads}, fill, table);
  }
}

}  // namespace traceflow::cuda

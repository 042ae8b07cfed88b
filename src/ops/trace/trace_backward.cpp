#include "ops/trace/trace_backward.h"

#include <algorithm>
#include <bit>

#include "base/parallel.h"

namespace traceflow::trace {

namespace {

// The surfels that the blocks' hits refer to, ascending.
std::vector<uint32_t> list_surfels(std::span<const SavedBlock> blocks, int64_t surfels) {
  constexpr size_t word_bits = 64;
  std::vector<uint64_t> hit(static_cast<size_t>(surfels) / word_bits + 1, 0);
  for (const SavedBlock& block : blocks) {
    for (const uint32_t s : block.surfel) hit[s / word_bits] |= uint64_t{1} << s % word_bits;
  }
  size_t count = 0;
  for (const uint64_t word : hit) count += static_cast<size_t>(std::popcount(word));
  std::vector<uint32_t> list;
  list.reserve(count);
  for (size_t i = 0; i < hit.size(); ++i) {
    for (uint64_t word = hit[i]; word != 0; word &= word - 1) {
      list.push_back(static_cast<uint32_t>(i * word_bits) + static_cast<uint32_t>(std::countr_zero(word)));
    }
  }
  return list;
}

}  // namespace

std::vector<Group> make_groups(const Saved& saved, int64_t surfels) {
  const size_t blocks = saved.blocks.size();
  std::vector<Group> groups((blocks + blocks_per_group - 1) / blocks_per_group);
  parallel_for(
      "trace group surfels", static_cast<int64_t>(groups.size()),
      [&](int64_t i) {
        Group& group = groups[static_cast<size_t>(i)];
        group.first_block = static_cast<size_t>(i) * blocks_per_group;
        group.last_block = std::min(blocks, group.first_block + blocks_per_group);
        group.surfels = list_surfels(
            std::span(saved.blocks).subspan(group.first_block, group.last_block - group.first_block),
            surfels);
      },
      1);
  return groups;
}

std::vector<BackwardFrame> make_backward_frames(const PosedSurfels& surfels) {
  std::vector<BackwardFrame> frames(static_cast<size_t>(surfels.count()));
  parallel_for("trace frames", surfels.count(), MakeFrame{surfels, frames.data()});
  return frames;
}

void finish_surfels(const PosedSurfels& surfels, const std::vector<BackwardFrame>& frames,
                    const std::vector<SurfelSums>& sums, InputGradient& gradient) {
  parallel_for("trace surfel gradients", surfels.count(),
               FinishSurfel{surfels, frames.data(), sums.data(), gradient});
}

}  // namespace traceflow::trace

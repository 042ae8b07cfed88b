#include "ops/trace/trace_backward.h"

#include "base/parallel.h"
#include "math/rotation.h"

namespace traceflow::trace {

void plan_chunk(const Saved& saved, int64_t surfels, size_t first_block, Chunk& chunk) {
  chunk.first_block = first_block;
  chunk.last_block = first_block;
  size_t hits = 0;
  do {
    hits += saved.blocks[chunk.last_block++].surfel.size();
  } while (chunk.last_block < saved.blocks.size() &&
           hits + saved.blocks[chunk.last_block].surfel.size() <= records_per_chunk);
  require(hits <= std::numeric_limits<uint32_t>::max(), "the hits of a chunk can be counted");

  const auto buckets = static_cast<size_t>((surfels + surfels_per_bucket - 1) / surfels_per_bucket);
  const size_t blocks = chunk.last_block - chunk.first_block;
  chunk.block_offsets.resize(blocks);
  parallel_for(
      "trace count", static_cast<int64_t>(blocks),
      [&](int64_t b) {
        std::vector<uint32_t>& count = chunk.block_offsets[static_cast<size_t>(b)];
        count.assign(buckets, 0);
        for (const uint32_t s : saved.blocks[first_block + static_cast<size_t>(b)].surfel) {
          ++count[s / surfels_per_bucket];
        }
      },
      1);
  chunk.bucket_begin.resize(buckets + 1);
  uint32_t next = 0;
  for (size_t bucket = 0; bucket < buckets; ++bucket) {
    chunk.bucket_begin[bucket] = next;
    for (std::vector<uint32_t>& offsets : chunk.block_offsets) {
      const uint32_t count = offsets[bucket];
      offsets[bucket] = next;
      next += count;
    }
  }
  chunk.bucket_begin[buckets] = next;
}

std::vector<BackwardFrame> make_backward_frames(const PosedSurfels& surfels) {
  std::vector<BackwardFrame> frames(static_cast<size_t>(surfels.count()));
  parallel_for("trace frames", surfels.count(), [&](int64_t i) {
    const Mat3<float> rotation = rotation_from_quaternion(load4<float>(surfels.rotation.row(i)));
    frames[static_cast<size_t>(i)] = {load3<float>(surfels.position.row(i)),
                                      rotation[0],
                                      rotation[1],
                                      rotation[2],
                                      {1 / surfels.scale(i, 0), 1 / surfels.scale(i, 1)},
                                      1 / surfels.opacity[i],
                                      0};
  });
  return frames;
}

void finish_surfels(const PosedSurfels& surfels, const std::vector<BackwardFrame>& frames,
                    const std::vector<Record>& sums, InputGradient& gradient) {
  parallel_for("trace surfel gradients", surfels.count(), [&](int64_t i) {
    const BackwardFrame& f = frames[static_cast<size_t>(i)];
    const Record& sum = sums[static_cast<size_t>(i)];
    const float* p = sum.value + part::position;
    const float* turned = sum.value + part::turn;
    if (p[0] != 0 || p[1] != 0 || p[2] != 0) {
      store3(gradient.surfels.position.row(i), p[0] * f.t_u + p[1] * f.t_v + p[2] * f.normal);
      // A rotation's gradient that has these turns: its other components do not matter to a unit quaternion.
      const Mat3<float> turn(turned[2] * f.t_v - turned[1] * f.normal, turned[0] * f.normal, Vec3<float>(0));
      const Vec4<float> q = rotation_from_quaternion_backward(load4<float>(surfels.rotation.row(i)), turn);
      for (int k = 0; k < 4; ++k) gradient.surfels.rotation(i, k) = q[k];
    }
    for (int k = 0; k < 2; ++k)
      gradient.surfels.scale(i, k) = sum.value[part::scale + static_cast<size_t>(k)];
    gradient.surfels.opacity[i] = sum.value[part::opacity];
    gradient.position_gradient[i] = sum.value[part::signal];
  });
}

}  // namespace traceflow::trace

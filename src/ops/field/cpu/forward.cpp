#include <algorithm>

#include "base/parallel.h"
#include "ops/field/cuda/network.h"
#include "ops/field/field.h"
#include "ops/field/field_kernels.h"
#include "ops/field/network.h"

namespace traceflow::field {

namespace {

// Working memory of one thread, kept between calls.
struct ForwardScratch {
  Tensor<float> encoding;
  Tensor<float> fp32;
  Tensor<float> head;
  Tensor<std::byte> activations;
};

// Allocates the activations of as many whole blocks as fit.
void reserve(const Layout& layout, int64_t points, Precision precision, Saved& saved) {
  const int64_t block_bytes = layout.depth * layout.hidden_bytes(layout.block_rows);
  saved.precision = precision;
  saved.kept_blocks = std::min(layout.blocks(points), saved.memory_limit / block_bytes);
  saved.activations.place(Device::cpu).resize({saved.kept_blocks * block_bytes});
}

void forward_block(const Layout& layout, const ForwardWeights& weights, const float* points, int64_t count,
                   std::byte* keep, float* output) {
  thread_local ForwardScratch scratch;
  const int64_t rows = layout.padded_rows(count);
  scratch.encoding.resize({rows, layout.padded_encoding});
  scratch.fp32.resize({rows, layout.width});
  scratch.head.resize({rows, layout.padded_outputs});
  if (keep == nullptr) scratch.activations.resize({2 * layout.hidden_bytes(rows)});

  encode_points(points, count, rows, layout.octaves, layout.padded_encoding, scratch.encoding.data());
  const Block block{.points = count,
                    .rows = rows,
                    .encoding = scratch.encoding.data(),
                    .activations = keep == nullptr ? scratch.activations.data() : keep,
                    .keep_all = keep != nullptr,
                    .fp32 = scratch.fp32.data()};
  forward_hidden(layout, weights, block);
  ForwardGemms(layout, rows)
      .head.run(block.layer(layout, layout.depth - 1), weights.head.data(), weights.head_bias.data(),
                scratch.head.data());
  for (int64_t i = 0; i < count; ++i) {
    float* row = output + i * layout.outputs;
    if (evaluated(points + 3 * i)) {
      std::copy_n(scratch.head.row(i), layout.outputs, row);
    } else {
      std::fill_n(row, layout.outputs, 0.0F);
    }
  }
}

}  // namespace

void forward(const Field& field, const Tensor<float>& points, float time, Precision precision,
             Tensor<float>& output, Saved* saved) {
  if (field.device() == Device::cuda) return device::forward(field, points, time, precision, output, saved);
  thread_local ForwardWeights weights;
  const Precision used = bf16_is_fast() ? precision : Precision::fp32;
  const Layout layout(field, used);
  const int64_t count = points.empty() ? 0 : points.dim(0);
  output.place(Device::cpu).resize({count, layout.outputs});
  if (saved != nullptr) reserve(layout, count, used, *saved);
  if (count == 0) return;

  ForwardWeights& filled = weights;  // the calling thread's; all threads read it
  filled.fill(layout, field, time);
  parallel_blocks("field forward", count, layout.block_rows, [&](int64_t begin, int64_t end) {
    const int64_t block = begin / layout.block_rows;
    const bool kept = saved != nullptr && block < saved->kept_blocks;
    std::byte* keep =
        kept ? saved->activations.data() + block * layout.depth * layout.hidden_bytes(layout.block_rows)
             : nullptr;
    forward_block(layout, filled, points.row(begin), end - begin, keep, output.row(begin));
  });
}

}  // namespace traceflow::field

#include <algorithm>

#include "base/parallel.h"
#include "ops/field/cuda/kernels.h"
#include "ops/field/cuda/network.h"
#include "ops/field/field.h"

namespace traceflow::field::device {

namespace {

// Allocates the activations of as many whole segments as fit.
void reserve(const DeviceLayout& layout, Precision precision, Saved& saved) {
  const int64_t bytes = Activations(layout, true).bytes;
  saved.precision = precision;
  saved.kept_blocks = std::min(layout.segments(), saved.memory_limit / bytes);
  const int64_t wanted = saved.kept_blocks * bytes;
  // A growing tensor allocates a quarter more, which may exceed the limit; a new one allocates exactly.
  if (wanted > saved.activations.size() && wanted + wanted / 4 > saved.memory_limit) saved.activations = {};
  saved.activations.place(Device::cuda).resize({wanted});
}

// The product of the heads.
void forward_heads(const DeviceLayout& layout, const Segment& segment, const std::byte* hidden,
                   const std::byte* weights, float* sums) {
  traceflow::cuda::multiply({.m = segment.rows,
                             .k = layout.width,
                             .n = layout.padded_outputs,
                             .transposed_b = true,
                             .stride_a = layout.width,
                             .stride_b = layout.width,
                             .stride_c = layout.padded_outputs,
                             .operands = layout.hidden,
                             .result = DType::fp32},
                            {.a = hidden, .b = weights, .c = sums});
}

}  // namespace

void forward(const Field& field, const Tensor<float>& points, float time, Precision precision,
             Tensor<float>& output, Saved* saved) {
  thread_local Tensor<std::byte> unsaved_weights;
  thread_local Tensor<float> sums;
  const int64_t count = points.empty() ? 0 : points.dim(0);
  const Precision used = precision_on_device(field, precision);
  const DeviceLayout layout(field, used, count);
  output.place(Device::cuda).resize({count, layout.outputs});
  if (saved != nullptr) saved->precision = used;
  if (count == 0) return;

  if (saved != nullptr) reserve(layout, used, *saved);
  Tensor<std::byte>& weights = saved != nullptr ? saved->weights : unsaved_weights;
  pack_weights(layout, field, time, weights);
  const int64_t kept = saved != nullptr ? saved->kept_blocks : 0;
  const Activations all(layout, true), two(layout, false);
  // backward recomputes activations by this same path; only their places in memory differ.
  const Activations& passing = saved != nullptr ? all : two;
  if (kept < layout.segments()) passing_memory().resize({passing.bytes});
  sums.place(Device::cuda).resize({layout.rows_in(0), layout.padded_outputs});
  const std::byte* const head_weights = weights.data() + PackedWeights(layout).weight[layout.depth];

  for (int64_t s = 0; s < layout.segments(); ++s) {
    const int64_t rows = layout.rows_in(s);
    const Activations& activations = s < kept ? all : passing;
    const Segment segment{
        .count = layout.points_in(s),
        .rows = rows,
        .points = points.row(s * layout.segment_rows),
        .memory = s < kept ? saved->activations.data() + s * all.bytes : passing_memory().data(),
        .masks = saved != nullptr && masks_supported(layout, rows)};
    forward_hidden(layout, weights.data(), activations, segment);
    forward_heads(layout, segment, activations.output(layout, layout.depth - 1, segment.memory), head_weights,
                  sums.data());
    parallel_for(Device::cuda, "field: output", segment.count * layout.outputs,
                 FinishOutput{segment.points, sums.data(), field.head_bias.data(), layout.outputs,
                              layout.padded_outputs, output.row(s * layout.segment_rows)});
  }
}

}  // namespace traceflow::field::device

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "ops/field/cuda/network.h"
#include "ops/field/field.h"
#include "ops/field/field_kernels.h"
#include "ops/field/network.h"

namespace traceflow::field {

namespace {

// Offset of each parameter's gradient in a group's sums, which are fp32 and dense.
struct GradientLayout {
  explicit GradientLayout(const Layout& l) {
    for (int layer = 0; layer < l.depth; ++layer) {
      bias.push_back(take(l.width));
      encoding.push_back(l.sees_encoding(layer) ? take(l.width * l.padded_encoding) : 0);
      hidden.push_back(layer > 0 ? take(l.width * l.width) : 0);
    }
    head = take(l.padded_outputs * l.width);
    head_bias = take(l.padded_outputs);
  }
  int64_t take(int64_t numbers) {
    const int64_t at = size;
    size += numbers;
    return at;
  }

  std::vector<int64_t> bias, encoding, hidden;
  int64_t head = 0;
  int64_t head_bias = 0;
  int64_t size = 0;
};

// A group of consecutive blocks shares one set of sums; the groups' sums are added in order. The number of
// groups depends only on the points, and bounds the memory.
struct Groups {
  explicit Groups(int64_t all_blocks)
      : blocks(all_blocks), count(std::clamp<int64_t>(all_blocks / 4, 1, 16)) {}
  int64_t first_block(int64_t group) const { return group * blocks / count; }

  int64_t blocks;
  int64_t count;
};

// What every block of a backward pass reads.
struct Pass {
  Layout layout;
  GradientLayout gradients;
  const ForwardWeights& forward;
  const BackwardWeights& backward;
  const Saved& saved;
};

// Working memory of one thread, kept between calls.
struct BackwardScratch {
  void resize(const Layout& layout, int64_t rows) {
    encoding.resize({rows, layout.padded_encoding});
    grad_output.resize({rows, layout.padded_outputs});
    grad_output_bf16.resize({rows, layout.padded_outputs});
    for (Tensor<float>& t : grad) t.resize({rows, layout.width});
    grad_bf16.resize({rows, layout.width});
  }
  Tensor<float> encoding;
  Tensor<float> grad_output;
  Tensor<uint16_t> grad_output_bf16;
  Tensor<float> grad[2];
  Tensor<uint16_t> grad_bf16;
  Tensor<std::byte> activations;
};

// Copies the valid rows of dL/doutput, padded, and adds their sum to grad_bias.
void load_grad_output(const Layout& layout, const float* points, const float* grad_output, int64_t count,
                      Tensor<float>& padded, float* grad_bias) {
  padded.zero();
  for (int64_t i = 0; i < count; ++i) {
    const float* from = grad_output + i * layout.outputs;
    const bool finite = std::all_of(from, from + layout.outputs, [](float g) { return std::isfinite(g); });
    if (!finite || !evaluated(points + 3 * i)) continue;
    std::copy_n(from, layout.outputs, padded.row(i));
    for (int k = 0; k < layout.outputs; ++k) grad_bias[k] += from[k];
  }
}

// The activations of a block, kept by forward or recomputed.
Block restore(const Pass& pass, int64_t index, int64_t count, int64_t rows, BackwardScratch& scratch) {
  const Layout& layout = pass.layout;
  Block block{.points = count,
              .rows = rows,
              .encoding = scratch.encoding.data(),
              .activations = nullptr,
              .keep_all = true,
              .fp32 = scratch.grad[0].data()};
  if (index < pass.saved.kept_blocks) {
    const int64_t offset = index * layout.depth * layout.hidden_bytes(layout.block_rows);
    block.activations =
        const_cast<std::byte*>(pass.saved.activations.data()) + offset;  // read-only from here on
  } else {
    scratch.activations.resize({layout.depth * layout.hidden_bytes(rows)});
    block.activations = scratch.activations.data();
    forward_hidden(layout, pass.forward, block);
  }
  return block;
}

// Adds one block's gradients to the group's sums, from the last layer to the first.
void backward_block(const Pass& pass, int64_t index, const float* points, const float* grad_output,
                    int64_t count, float* sums) {
  thread_local BackwardScratch scratch;
  const Layout& layout = pass.layout;
  const GradientLayout& at = pass.gradients;
  const int64_t rows = layout.padded_rows(count);
  const BackwardGemms gemms(layout, rows);
  const bool rounds = layout.hidden == DType::bf16;
  scratch.resize(layout, rows);
  encode_points(points, count, rows, layout.octaves, layout.padded_encoding, scratch.encoding.data());
  const Block block = restore(pass, index, count, rows, scratch);

  load_grad_output(layout, points, grad_output, count, scratch.grad_output, sums + at.head_bias);
  const void* grad = scratch.grad_output.data();
  if (rounds) {
    round_to_bf16(scratch.grad_output.data(), scratch.grad_output.size(), scratch.grad_output_bf16.data());
    grad = scratch.grad_output_bf16.data();
  }
  gemms.grad_head.run(grad, block.layer(layout, layout.depth - 1), nullptr, sums + at.head);
  float* current = scratch.grad[0].data();
  float* next = scratch.grad[1].data();
  gemms.head.run(grad, pass.backward.head.data(), nullptr, current);

  for (int layer = layout.depth - 1; layer >= 0; --layer) {
    mask_by_activation(block.layer(layout, layer), layout.hidden, rows, layout.width, current,
                       scratch.grad_bf16.data(), sums + at.bias[layer]);
    if (layout.sees_encoding(layer)) {
      gemms.grad_encoding.run(current, block.encoding, nullptr, sums + at.encoding[layer]);
    }
    if (layer == 0) break;
    grad = rounds ? static_cast<const void*>(scratch.grad_bf16.data()) : current;
    gemms.grad_hidden.run(grad, block.layer(layout, layer - 1), nullptr, sums + at.hidden[layer]);
    gemms.hidden.run(grad, pass.backward.hidden[layer].data(), nullptr, next);
    std::swap(current, next);
  }
}

// Adds the groups' sums of row `o` of a layer to the field's gradient. The time's encoding is the same for
// all points, so the gradient of its columns is (dL/dbias) γ(t).
void add_row(const Pass& pass, const Tensor<float>& sums, int layer, int64_t o,
             const std::vector<double>& time, Field& grad_field) {
  const Layout& layout = pass.layout;
  const GradientLayout& at = pass.gradients;
  const int64_t groups = sums.dim(0);
  const auto add = [&](int64_t offset, int64_t count, float* to) {
    add_slots(sums.data() + offset, groups, at.size, count, to);
  };
  float* row = grad_field.weight[layer].row(o);
  if (layout.sees_encoding(layer)) {
    add(at.encoding[layer] + o * layout.padded_encoding, layout.encoding, row);
    float grad_bias = 0;
    add(at.bias[layer] + o, 1, &grad_bias);
    for (size_t j = 0; j < time.size(); ++j) {
      row[layout.encoding + static_cast<int64_t>(j)] += static_cast<float>(grad_bias * time[j]);
    }
    row += layout.encoding + layout.time_encoding;
  }
  if (layer > 0) add(at.hidden[layer] + o * layout.width, layout.width, row);
  if (o == 0) add(at.bias[layer], layout.width, grad_field.bias[layer].data());
}

void add_groups(const Pass& pass, const Tensor<float>& sums, float time, Field& grad_field) {
  const Layout& layout = pass.layout;
  const std::vector<double> encoded_time = encode_time(layout, time);
  const auto add = [&](int64_t i) {
    add_row(pass, sums, static_cast<int>(i / layout.width), i % layout.width, encoded_time, grad_field);
  };
  parallel_for("field gradients", static_cast<int64_t>(layout.depth) * layout.width, add, 64);
  const GradientLayout& at = pass.gradients;
  add_slots(sums.data() + at.head, sums.dim(0), at.size, grad_field.head_weight.size(),
            grad_field.head_weight.data());
  add_slots(sums.data() + at.head_bias, sums.dim(0), at.size, layout.outputs, grad_field.head_bias.data());
}

}  // namespace

void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field) {
  if (field.device() == Device::cuda) {
    return device::backward(field, points, time, saved, grad_output, grad_field);
  }
  thread_local ForwardWeights forward_weights;
  thread_local BackwardWeights backward_weights;
  thread_local Tensor<float> group_sums;
  if (points.empty()) return;
  const int64_t count = points.dim(0);
  const Layout layout(field, saved.precision);
  require(grad_output.shape() == Shape({count, layout.outputs}), "grad_output has the shape of the output",
          grad_output.shape().to_string());

  const Groups groups(layout.blocks(count));
  backward_weights.fill(layout, field);
  if (saved.kept_blocks < groups.blocks) forward_weights.fill(layout, field, time);
  const Pass pass{layout, GradientLayout(layout), forward_weights, backward_weights, saved};
  Tensor<float>& sums = group_sums;
  sums.resize({groups.count, pass.gradients.size});
  parallel_blocks("field backward", groups.count, 1, [&](int64_t group, int64_t) {
    std::fill_n(sums.row(group), pass.gradients.size, 0.0F);
    for (int64_t block = groups.first_block(group); block < groups.first_block(group + 1); ++block) {
      const int64_t begin = block * layout.block_rows;
      const int64_t end = std::min(count, begin + layout.block_rows);
      backward_block(pass, block, points.row(begin), grad_output.row(begin), end - begin, sums.row(group));
    }
  });
  add_groups(pass, sums, time, grad_field);
}

}  // namespace traceflow::field

#include "ops/field/network.h"

#include <algorithm>

#include "base/parallel.h"
#include "math/encoding.h"
#include "ops/field/field_kernels.h"

namespace traceflow::field {

namespace {

int padded(int columns) { return (columns + 15) / 16 * 16; }

// Hidden values of one layer of a block, chosen by measurement (bench/field.cpp): a quarter of a megabyte in
// fp32.
constexpr int64_t block_values = 65536;

// Packs a product's B, weightᵀ or `weight`, from `columns` columns of a row-major matrix.
void pack(const Gemm& gemm, const float* weight, int64_t columns, bool transposed,
          Tensor<std::byte>& packed) {
  packed.resize({gemm.packed_bytes()});
  gemm.pack(weight, transposed ? 1 : columns, transposed ? columns : 1, packed.data());
}

// The first columns of a matrix, zero-padded to the new shape.
Tensor<float> padded_copy(const Tensor<float>& from, int64_t columns, const Shape& shape) {
  Tensor<float> to(shape);
  for (int64_t i = 0; i < from.dim(0); ++i) std::copy_n(from.row(i), columns, to.row(i));
  return to;
}

// The first column of a layer's weights that multiplies hidden values.
int64_t hidden_column(const Layout& layout, int layer) {
  return layout.sees_encoding(layer) ? layout.encoding + layout.time_encoding : 0;
}

// bias += W_t γ(t); W_t is the columns of the time's encoding.
void add_time(const Layout& layout, const Tensor<float>& weight, const std::vector<double>& time_encoding,
              Tensor<float>& bias) {
  for (int64_t o = 0; o < layout.width; ++o) {
    double sum = bias[o];
    for (int j = 0; j < layout.time_encoding; ++j) {
      sum += static_cast<double>(weight(o, layout.encoding + j)) * time_encoding[j];
    }
    bias[o] = static_cast<float>(sum);
  }
}

}  // namespace

Layout::Layout(const Field& field, Precision precision)
    : depth(field.shape.depth),
      width(field.shape.width),
      skip(field.shape.skip),
      outputs(field.outputs()),
      octaves(field.shape.position_frequencies),
      encoding(encoding_size(3, octaves)),
      time_encoding(encoding_size(1, field.shape.time_frequencies)),
      padded_encoding(padded(encoding)),
      padded_outputs(padded(outputs)),
      hidden(precision == Precision::bf16 ? DType::bf16 : DType::fp32),
      block_rows(std::clamp<int64_t>(block_values / width / 64 * 64, 64, 1024)) {
  field.shape.validate();
  require(field.weight.size() == static_cast<size_t>(depth) && field.bias.size() == field.weight.size(),
          "a field has as many layers as its shape says", std::to_string(field.weight.size()));
}

std::vector<double> encode_time(const Layout& layout, float time) {
  std::vector<double> encoded(static_cast<size_t>(layout.time_encoding));
  const double t = time;
  positional_encoding(&t, 1, (layout.time_encoding - 1) / 2, encoded.data());
  return encoded;
}

void ForwardWeights::fill(const Layout& layout, const Field& field, float time) {
  const ForwardGemms gemms(layout, layout.block_rows);
  const std::vector<double> time_encoding = encode_time(layout, time);
  const auto layers = static_cast<size_t>(layout.depth);
  bias.resize(layers);
  encoding.resize(layers);
  hidden.resize(layers);
  const auto fill_layer = [&](int64_t index) {
    const int layer = static_cast<int>(index);
    const Tensor<float>& weight = field.weight[layer];
    bias[layer] = field.bias[layer];
    if (layout.sees_encoding(layer)) {
      add_time(layout, weight, time_encoding, bias[layer]);
      const auto part = padded_copy(weight, layout.encoding, {layout.width, layout.padded_encoding});
      const Gemm& gemm = layer == 0 ? gemms.first : gemms.skip_encoding;
      pack(gemm, part.data(), layout.padded_encoding, true, encoding[layer]);
    }
    if (layer > 0) {
      const Gemm& gemm = layer == layout.skip ? gemms.skip_hidden : gemms.hidden;
      pack(gemm, weight.data() + hidden_column(layout, layer), weight.dim(1), true, hidden[layer]);
    }
  };
  parallel_for("field weights", layout.depth, fill_layer, 1);
  const auto padded_head =
      padded_copy(field.head_weight, layout.width, {layout.padded_outputs, layout.width});
  pack(gemms.head, padded_head.data(), layout.width, true, head);
  head_bias.reset({layout.padded_outputs});
  std::copy_n(field.head_bias.data(), layout.outputs, head_bias.data());
}

void BackwardWeights::fill(const Layout& layout, const Field& field) {
  const BackwardGemms gemms(layout, layout.block_rows);
  hidden.resize(static_cast<size_t>(layout.depth));
  const auto fill_layer = [&](int64_t index) {
    const int layer = static_cast<int>(index) + 1;
    const Tensor<float>& weight = field.weight[layer];
    pack(gemms.hidden, weight.data() + hidden_column(layout, layer), weight.dim(1), false, hidden[layer]);
  };
  parallel_for("field weights", layout.depth - 1, fill_layer, 1);
  const auto padded_head =
      padded_copy(field.head_weight, layout.width, {layout.padded_outputs, layout.width});
  pack(gemms.head, padded_head.data(), layout.width, false, head);
}

ForwardGemms::ForwardGemms(const Layout& l, int64_t rows)
    : first(gemm({.m = rows,
                  .k = l.padded_encoding,
                  .n = l.width,
                  .packed_for = l.block_rows,
                  .bias = true,
                  .relu = true})),
      skip_encoding(
          gemm({.m = rows, .k = l.padded_encoding, .n = l.width, .packed_for = l.block_rows, .bias = true})),
      skip_hidden(gemm({.m = rows,
                        .k = l.width,
                        .n = l.width,
                        .operands = l.hidden,
                        .packed_for = l.block_rows,
                        .accumulate = true,
                        .relu = true})),
      hidden(gemm({.m = rows,
                   .k = l.width,
                   .n = l.width,
                   .operands = l.hidden,
                   .result = l.hidden,
                   .packed_for = l.block_rows,
                   .bias = true,
                   .relu = true})),
      head(gemm({.m = rows,
                 .k = l.width,
                 .n = l.padded_outputs,
                 .operands = l.hidden,
                 .packed_for = l.block_rows,
                 .bias = true})) {}

BackwardGemms::BackwardGemms(const Layout& l, int64_t rows)
    : head(gemm({.m = rows,
                 .k = l.padded_outputs,
                 .n = l.width,
                 .operands = l.hidden,
                 .packed_for = l.block_rows})),
      hidden(gemm({.m = rows, .k = l.width, .n = l.width, .operands = l.hidden, .packed_for = l.block_rows})),
      grad_encoding(
          gemm({.m = l.width, .k = rows, .n = l.padded_encoding, .transposed = true, .accumulate = true})),
      grad_hidden(gemm({.m = l.width,
                        .k = rows,
                        .n = l.width,
                        .operands = l.hidden,
                        .transposed = true,
                        .accumulate = true})),
      grad_head(gemm({.m = l.padded_outputs,
                      .k = rows,
                      .n = l.width,
                      .operands = l.hidden,
                      .transposed = true,
                      .accumulate = true})) {}

void forward_hidden(const Layout& layout, const ForwardWeights& weights, const Block& block) {
  const ForwardGemms gemms(layout, block.rows);
  const bool rounds = layout.hidden == DType::bf16;
  for (int layer = 0; layer < layout.depth; ++layer) {
    std::byte* values = block.layer(layout, layer);
    const float* bias = weights.bias[layer].data();
    if (!layout.sees_encoding(layer)) {
      gemms.hidden.run(block.layer(layout, layer - 1), weights.hidden[layer].data(), bias, values);
      continue;
    }
    float* sums = rounds ? block.fp32 : reinterpret_cast<float*>(values);
    const std::byte* encoding_weight = weights.encoding[layer].data();
    if (layer == 0) {
      gemms.first.run(block.encoding, encoding_weight, bias, sums);
    } else {
      gemms.skip_encoding.run(block.encoding, encoding_weight, bias, sums);
      gemms.skip_hidden.run(block.layer(layout, layer - 1), weights.hidden[layer].data(), nullptr, sums);
    }
    if (rounds) round_to_bf16(sums, block.rows * layout.width, reinterpret_cast<uint16_t*>(values));
  }
}

}  // namespace traceflow::field

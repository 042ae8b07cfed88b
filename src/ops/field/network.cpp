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

// Writes a dense fp32 matrix in the number type of the hidden values.
void store(Number number, const Tensor<float>& from, Tensor<std::byte>& to) {
  if (number == Number::fp32) {
    to.resize({from.size() * 4});
    std::copy(from.data(), from.data() + from.size(), reinterpret_cast<float*>(to.data()));
  } else {
    to.resize({from.size() * 2});
    round_to_bf16(from.data(), from.size(), reinterpret_cast<uint16_t*>(to.data()));
  }
}

// to[c][o] = weight[o][first + c] for c < columns and all outputs o; the rest of `to` is zero.
void transpose(const Tensor<float>& weight, int64_t first, int64_t columns, const Shape& shape,
               Tensor<float>& to) {
  constexpr int64_t tile = 16;
  to.reset(shape);
  const int64_t outputs = weight.dim(0);
  for (int64_t o = 0; o < outputs; o += tile) {
    for (int64_t c = 0; c < columns; ++c) {
      for (int64_t k = o; k < std::min(o + tile, outputs); ++k) to(c, k) = weight(k, first + c);
    }
  }
}

// The first column of the hidden values' weights in a layer.
int64_t hidden_column(const Layout& layout, int layer) {
  return layout.sees_encoding(layer) ? layout.encoding + layout.time_encoding : 0;
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
      hidden(precision == Precision::bf16 ? Number::bf16 : Number::fp32),
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
      transpose(weight, 0, layout.encoding, {layout.padded_encoding, layout.width}, encoding[layer]);
      for (int64_t o = 0; o < layout.width; ++o) {
        double sum = field.bias[layer][o];
        for (int j = 0; j < layout.time_encoding; ++j) {
          sum += static_cast<double>(weight(o, layout.encoding + j)) * time_encoding[j];
        }
        bias[layer][o] = static_cast<float>(sum);
      }
    }
    if (layer > 0) {
      thread_local Tensor<float> transposed;
      transpose(weight, hidden_column(layout, layer), layout.width, {layout.width, layout.width}, transposed);
      // The skip's sum is fp32 but its operands are hidden values like all others.
      store(layout.hidden, transposed, hidden[layer]);
    }
  };
  parallel_for("field weights", layout.depth, fill_layer, 1);
  Tensor<float> transposed;
  transpose(field.head_weight, 0, layout.width, {layout.width, layout.padded_outputs}, transposed);
  store(layout.hidden, transposed, head);
  head_bias.reset({layout.padded_outputs});
  std::copy_n(field.head_bias.data(), layout.outputs, head_bias.data());
}

void BackwardWeights::fill(const Layout& layout, const Field& field) {
  hidden.resize(static_cast<size_t>(layout.depth));
  const auto fill_layer = [&](int64_t index) {
    const int layer = static_cast<int>(index) + 1;
    const Tensor<float>& weight = field.weight[layer];
    thread_local Tensor<float> dense;
    dense.resize({layout.width, layout.width});
    for (int64_t o = 0; o < layout.width; ++o) {
      std::copy_n(weight.row(o) + hidden_column(layout, layer), layout.width, dense.row(o));
    }
    store(layout.hidden, dense, hidden[layer]);
  };
  parallel_for("field weights", layout.depth - 1, fill_layer, 1);
  Tensor<float> padded_head(Shape{layout.padded_outputs, layout.width});
  std::copy(field.head_weight.data(), field.head_weight.data() + field.head_weight.size(),
            padded_head.data());
  store(layout.hidden, padded_head, head);
}

ForwardProducts::ForwardProducts(const Layout& l, int64_t rows)
    : first(product({.m = rows, .k = l.padded_encoding, .n = l.width, .bias = true, .relu = true})),
      skip_encoding(product({.m = rows, .k = l.padded_encoding, .n = l.width, .bias = true})),
      skip_hidden(product(
          {.m = rows, .k = l.width, .n = l.width, .operands = l.hidden, .accumulate = true, .relu = true})),
      hidden(product({.m = rows,
                      .k = l.width,
                      .n = l.width,
                      .operands = l.hidden,
                      .result = l.hidden,
                      .bias = true,
                      .relu = true})),
      head(product({.m = rows, .k = l.width, .n = l.padded_outputs, .operands = l.hidden, .bias = true})) {}

BackwardProducts::BackwardProducts(const Layout& l, int64_t rows)
    : head(product({.m = rows, .k = l.padded_outputs, .n = l.width, .operands = l.hidden})),
      hidden(product({.m = rows, .k = l.width, .n = l.width, .operands = l.hidden})),
      grad_encoding(
          product({.m = l.width, .k = rows, .n = l.padded_encoding, .transposed = true, .accumulate = true})),
      grad_hidden(product({.m = l.width,
                           .k = rows,
                           .n = l.width,
                           .operands = l.hidden,
                           .transposed = true,
                           .accumulate = true})),
      grad_head(product({.m = l.padded_outputs,
                         .k = rows,
                         .n = l.width,
                         .operands = l.hidden,
                         .transposed = true,
                         .accumulate = true})) {}

void forward_hidden(const Layout& layout, const ForwardWeights& weights, const Block& block) {
  const ForwardProducts products(layout, block.rows);
  const bool rounds = layout.hidden == Number::bf16;
  for (int layer = 0; layer < layout.depth; ++layer) {
    std::byte* values = block.layer(layout, layer);
    const float* bias = weights.bias[layer].data();
    if (!layout.sees_encoding(layer)) {
      products.hidden.run(block.layer(layout, layer - 1), weights.hidden[layer].data(), bias, values);
      continue;
    }
    float* sums = rounds ? block.fp32 : reinterpret_cast<float*>(values);
    const float* encoding_weight = weights.encoding[layer].data();
    if (layer == 0) {
      products.first.run(block.encoding, encoding_weight, bias, sums);
    } else {
      products.skip_encoding.run(block.encoding, encoding_weight, bias, sums);
      products.skip_hidden.run(block.layer(layout, layer - 1), weights.hidden[layer].data(), nullptr, sums);
    }
    if (rounds) round_to_bf16(sums, block.rows * layout.width, reinterpret_cast<uint16_t*>(values));
  }
}

}  // namespace traceflow::field

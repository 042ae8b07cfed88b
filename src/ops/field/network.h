#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "ops/field/field.h"
#include "ops/field/gemm.h"

// How the fast path sees a network (method §1.2). Points go through all layers in blocks small enough that a
// block's hidden values stay in a core's second-level cache. The time's encoding is the same for every point,
// so its product is part of the biases; what remains of the encoding, the point's, is padded with zeros to a
// multiple of 16 columns, as are the outputs.
namespace traceflow::field {

struct Layout {
  Layout(const Field& field, Precision precision);

  int depth, width, skip, outputs;
  int octaves;          // of the point
  int encoding;         // numbers of the point's encoding
  int time_encoding;    // and of the time's, behind them
  int padded_encoding;  // multiples of 16
  int padded_outputs;
  DType hidden;        // number type of the hidden values
  int64_t block_rows;  // points in a block

  bool sees_encoding(int layer) const { return layer == 0 || layer == skip; }
  int64_t blocks(int64_t points) const { return (points + block_rows - 1) / block_rows; }
  // Rows that a block of the given number of points is padded to: few different ones, so that few products
  // are compiled.
  int64_t padded_rows(int64_t points) const { return (points + 63) / 64 * 64; }
  int64_t hidden_bytes(int64_t rows) const { return rows * width * (hidden == DType::fp32 ? 4 : 2); }
};

// γ(t).
std::vector<double> encode_time(const Layout& layout, float time);

// The products that take `rows` points through the layers. Their weights are packed for full blocks.
struct ForwardGemms {
  ForwardGemms(const Layout& layout, int64_t rows);

  const Gemm& first;          // encoding → hidden values of layer 0, fp32
  const Gemm& skip_encoding;  // encoding → its part of the skip layer, fp32
  const Gemm& skip_hidden;    // onto that part → hidden values of the skip layer, fp32
  const Gemm& hidden;         // hidden → hidden values of the other layers
  const Gemm& head;           // hidden → outputs, fp32
};
struct BackwardGemms {
  BackwardGemms(const Layout& layout, int64_t rows);

  const Gemm& head;           // gradient of the outputs → of the last hidden values, fp32
  const Gemm& hidden;         // gradient of a layer's values → of those before it, fp32
  const Gemm& grad_encoding;  // the three add to a weight's gradient, fp32
  const Gemm& grad_hidden;
  const Gemm& grad_head;
};

// The parameters as the products read them, packed anew by each pass over the points.
struct ForwardWeights {
  void fill(const Layout& layout, const Field& field, float time);

  std::vector<Tensor<float>> bias;          // layer: width; the time's part included
  std::vector<Tensor<std::byte>> encoding;  // layer that sees it: padded_encoding × width
  std::vector<Tensor<std::byte>> hidden;    // layer > 0: width × width, transposed
  Tensor<std::byte> head;                   // width × padded_outputs
  Tensor<float> head_bias;                  // padded_outputs
};
struct BackwardWeights {
  void fill(const Layout& layout, const Field& field);

  std::vector<Tensor<std::byte>> hidden;  // layer > 0: width × width
  Tensor<std::byte> head;                 // padded_outputs × width
};

// A block of points on its way through the layers, and where its hidden values are.
struct Block {
  int64_t points;  // in the block
  int64_t rows;    // with padding
  const float* encoding;
  std::byte* activations;  // layer after layer, each rows × width
  bool keep_all;           // else only the last two layers, in turns
  float* fp32;             // rows × width, working memory

  std::byte* layer(const Layout& layout, int index) const {
    return activations + (keep_all ? index : index % 2) * layout.hidden_bytes(rows);
  }
};

// Fills the hidden values of all layers of a block.
void forward_hidden(const Layout& layout, const ForwardWeights& weights, const Block& block);

}  // namespace traceflow::field

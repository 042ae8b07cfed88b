#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "ops/field/field.h"
#include "ops/field/gemm.h"

// Layout of a network on the CPU (method §1.2). Points pass through all layers in blocks so small that a
// block's hidden values stay in a core's second-level cache. The time's encoding is the same for every point,
// so its product is part of the biases. The point's encoding is zero-padded to a multiple of 16 columns, as
// are the outputs.
namespace traceflow::field {

struct Layout {
  Layout(const Field& field, Precision precision);

  int depth, width, skip, outputs;
  int octaves;          // of the point
  int encoding;         // numbers of the point's encoding
  int time_encoding;    // numbers of the time's encoding, which follows
  int padded_encoding;  // multiples of 16
  int padded_outputs;
  DType hidden;        // type of the hidden values
  int64_t block_rows;  // points in a block

  bool sees_encoding(int layer) const { return layer == 0 || layer == skip; }
  int64_t blocks(int64_t points) const { return (points + block_rows - 1) / block_rows; }
  // Padded rows of a block with this number of points. There are few different values, so that few products
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
  const Gemm& grad_encoding;  // these three add to a weight's gradient, fp32
  const Gemm& grad_hidden;
  const Gemm& grad_head;
};

// The parameters in the format of the products, packed again by each pass over the points.
struct ForwardWeights {
  void fill(const Layout& layout, const Field& field, float time);

  std::vector<Tensor<float>> bias;          // per layer: width; includes the time's part
  std::vector<Tensor<std::byte>> encoding;  // per layer that sees it: padded_encoding × width
  std::vector<Tensor<std::byte>> hidden;    // per layer > 0: width × width, transposed
  Tensor<std::byte> head;                   // width × padded_outputs
  Tensor<float> head_bias;                  // padded_outputs
};
struct BackwardWeights {
  void fill(const Layout& layout, const Field& field);

  std::vector<Tensor<std::byte>> hidden;  // per layer > 0: width × width
  Tensor<std::byte> head;                 // padded_outputs × width
};

// A block of points on its way through the layers, and the memory of its hidden values.
struct Block {
  int64_t points;  // number of its points
  int64_t rows;    // padded
  const float* encoding;
  std::byte* activations;  // layer after layer, each rows × width
  bool keep_all;           // otherwise only the last two layers, alternating
  float* fp32;             // rows × width, working memory

  std::byte* layer(const Layout& layout, int index) const {
    return activations + (keep_all ? index : index % 2) * layout.hidden_bytes(rows);
  }
};

// Computes the hidden values of all layers of a block.
void forward_hidden(const Layout& layout, const ForwardWeights& weights, const Block& block);

}  // namespace traceflow::field

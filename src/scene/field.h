#pragma once

#include <vector>

#include "base/options.h"
#include "base/random.h"
#include "base/tensor.h"

namespace traceflow {

// The shape of a residual field's network (method §1.2). Defaults are those of the paper.
struct NetworkOptions {
  int depth = 8;
  int width = 256;
  int skip = 5;
  int position_frequencies = 10;
  int time_frequencies = 6;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("depth", depth, "layers", "Number of linear layers before the heads (method §1.2).");
    v.field("width", width, "units", "Width of the hidden layers.");
    v.field("skip", skip, "layer",
            "Layer (counted from 0) before which the encoding is concatenated again; 0: none.");
    v.field("position_frequencies", position_frequencies, "octaves",
            "Number of frequencies in the encoding of the position.");
    v.field("time_frequencies", time_frequencies, "octaves",
            "Number of frequencies in the encoding of the time.");
  }
  void validate() const;
  // Numbers in the encoding of (x, t): 3·(1 + 2·L_x) + 1 + 2·L_t.
  int encoding_size() const { return 3 + 6 * position_frequencies + 1 + 2 * time_frequencies; }
  // Inputs of a layer: the encoding for the first, [encoding, hidden] at the skip, otherwise hidden.
  int layer_inputs(int layer) const {
    return layer == 0 ? encoding_size() : layer == skip ? encoding_size() + width : width;
  }
};

// The parameters of one residual field F(x, t): R³×[0,1] → R^outputs, and also their gradients and moments.
// Order of the encoding: x, sin 2⁰x, cos 2⁰x, …, sin 2^{L-1}x, cos 2^{L-1}x (three numbers each), then the
// same for t.
template <class T>
struct BasicField {
  NetworkOptions shape;
  std::vector<Tensor<T>>
      weight;  // layer l: width × layer_inputs(l), row-major; at the skip the encoding comes first
  std::vector<Tensor<T>> bias;  // layer l: width
  Tensor<T> head_weight;        // outputs × width: all linear heads stacked
  Tensor<T> head_bias;          // outputs

  int outputs() const { return head_bias.empty() ? 0 : static_cast<int>(head_bias.dim(0)); }

  Device device() const { return head_weight.device(); }
  // A copy on a device.
  BasicField on(Device device) const {
    BasicField result;
    result.shape = shape;
    for (const auto& w : weight) result.weight.push_back(w.on(device));
    for (const auto& b : bias) result.bias.push_back(b.on(device));
    result.head_weight = head_weight.on(device);
    result.head_bias = head_bias.on(device);
    return result;
  }

  // Takes the shapes and the device of another field, and reuses the memory.
  void resize_like(const BasicField& other) {
    const auto resize = [](Tensor<T>& tensor, const Tensor<T>& like) {
      tensor.place(like.device()).resize(like.shape());
    };
    shape = other.shape;
    weight.resize(other.weight.size());
    bias.resize(other.bias.size());
    for (size_t l = 0; l < weight.size(); ++l) resize(weight[l], other.weight[l]);
    for (size_t l = 0; l < bias.size(); ++l) resize(bias[l], other.bias[l]);
    resize(head_weight, other.head_weight);
    resize(head_bias, other.head_bias);
  }

  // Calls f(name, tensor) for every parameter tensor: "weight0", "bias0", …, "head_weight", "head_bias".
  template <class F>
  void for_each(F&& f) {
    visit(*this, f);
  }
  template <class F>
  void for_each(F&& f) const {
    visit(*this, f);
  }

 private:
  template <class Self, class F>
  static void visit(Self& self, F&& f) {
    for (size_t l = 0; l < self.weight.size(); ++l) {
      f("weight" + std::to_string(l), self.weight[l]);
      f("bias" + std::to_string(l), self.bias[l]);
    }
    f(std::string("head_weight"), self.head_weight);
    f(std::string("head_bias"), self.head_bias);
  }
};
using Field = BasicField<float>;

// Hidden layers uniform in ±1/√inputs, heads zero, so that F ≡ 0 at the start (method §1.2).
Field make_field(const NetworkOptions& shape, int outputs, Random& random);

// Zeros in the shapes of another field, on its device.
template <class To, class From>
BasicField<To> zeros_like(const BasicField<From>& field) {
  const Device device = field.device();
  BasicField<To> result;
  result.shape = field.shape;
  for (const auto& w : field.weight) result.weight.emplace_back(w.shape(), device);
  for (const auto& b : field.bias) result.bias.emplace_back(b.shape(), device);
  result.head_weight = Tensor<To>(field.head_weight.shape(), device);
  result.head_bias = Tensor<To>(field.head_bias.shape(), device);
  return result;
}
template <class To, class From>
BasicField<To> convert(const BasicField<From>& field) {
  BasicField<To> result;
  result.shape = field.shape;
  for (const auto& w : field.weight) result.weight.push_back(convert<To>(w));
  for (const auto& b : field.bias) result.bias.push_back(convert<To>(b));
  result.head_weight = convert<To>(field.head_weight);
  result.head_bias = convert<To>(field.head_bias);
  return result;
}

// Index of each residual in a field's output row (method §1.2). The environment has no tint.
namespace residual {
inline constexpr int position = 0;
inline constexpr int rotation = 3;
inline constexpr int log_scale = 7;
inline constexpr int opacity = 9;
inline constexpr int tint = 10;
inline constexpr int main_outputs = 11;
inline constexpr int environment_outputs = 10;
}  // namespace residual

}  // namespace traceflow

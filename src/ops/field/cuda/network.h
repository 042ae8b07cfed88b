#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "math/bf16.h"
#include "ops/field/field.h"
#include "ops/field/network.h"
#include "primitives/gemm.h"

// Layout of a network on the CUDA device (method §1.2). Points pass through all layers in segments. The
// hidden values of two layers of a segment fit in the second-level cache of a large device. The encoding and
// the hidden values before the skip share the rows of one matrix, so that each layer is one product.
namespace traceflow::field::device {

// Hidden values of a layer in a segment. Tests reduce it.
inline int64_t segment_values = int64_t{1} << 23;

struct DeviceLayout : Layout {
  DeviceLayout(const Field& field, Precision precision, int64_t count);

  int64_t points;
  int64_t segment_rows;  // points in a segment
  int parts;             // stored numbers per number of the encoding (cuda/kernels.h)
  int64_t number_bytes;

  int64_t segments() const { return (points + segment_rows - 1) / segment_rows; }
  // Points in a segment, and padded rows. There are few different values, so that few products are planned.
  int64_t points_in(int64_t segment) const;
  int64_t rows_in(int64_t segment) const;

  // Columns of the wide matrix: the encoding and, with a skip, the hidden values before it.
  int64_t wide_columns() const { return int64_t{parts} * padded_encoding + (skip > 0 ? width : 0); }
  bool ends_wide(int layer) const { return skip > 0 && layer == skip - 1; }
  int64_t output_stride(int layer) const { return ends_wide(layer) ? wide_columns() : width; }
  int64_t input_columns(int layer) const {
    return (sees_encoding(layer) ? parts * padded_encoding : 0) + (layer > 0 ? width : 0);
  }
  int64_t input_stride(int layer) const { return sees_encoding(layer) ? wide_columns() : width; }
  // The first part of the encoding equals the second, and has no gradient of its own.
  int64_t gradient_column(int layer) const {
    return sees_encoding(layer) && parts == 3 ? padded_encoding : 0;
  }
  int64_t gradient_columns(int layer) const { return input_columns(layer) - gradient_column(layer); }
  int64_t mask_stride() const { return (width + 127) / 128 * 128; }  // bits
};

// Divides one allocation into aligned parts.
class Share {
 public:
  int64_t take(int64_t bytes) {
    const int64_t at = size_;
    size_ += (bytes + 255) / 256 * 256;
    return at;
  }
  int64_t size() const { return size_; }

 private:
  int64_t size_ = 0;
};

// Offsets of the parts of a segment's activations.
struct Activations {
  // keep_all: keep every layer. Otherwise layers alternate between two places, except those that must not.
  Activations(const DeviceLayout& layout, bool keep_all);

  std::byte* output(const DeviceLayout& layout, int layer, std::byte* segment) const;
  std::byte* input(const DeviceLayout& layout, int layer, std::byte* segment) const {
    return layout.sees_encoding(layer) ? segment : output(layout, layer - 1, segment);
  }
  std::byte* mask(int layer, std::byte* segment) const { return segment + masks + layer * mask_bytes; }

  bool keep_all;
  int64_t hidden = 0, hidden_bytes = 0;  // after the wide matrix, which comes first
  int64_t masks = 0, mask_bytes = 0;
  int64_t bytes = 0;
};

// Offsets of the weights in the format of the products.
struct PackedWeights {
  explicit PackedWeights(const DeviceLayout& layout);

  std::vector<int64_t> weight, bias;  // per layer, the heads last
  int64_t bytes = 0;
};
void pack_weights(const DeviceLayout& layout, const Field& field, float time, Tensor<std::byte>& packed);

// A segment on its way through the layers.
struct Segment {
  int64_t count;  // number of its points
  int64_t rows;   // padded
  const float* points;
  std::byte* memory;
  bool masks;  // ReLUs write masks for backward
};

// Memory for the activations of a segment that are not kept, valid until the next segment. Both passes use
// it.
Tensor<std::byte>& passing_memory();

// Whether the library can write and read the masks of all layers. Then backward need not read the
// activations.
bool masks_supported(const DeviceLayout& layout, int64_t rows);

// Computes the encoding and the hidden values of all layers of a segment.
void forward_hidden(const DeviceLayout& layout, const std::byte* weights, const Activations& activations,
                    const Segment& segment);

// Computes dL/dinput of a layer (or, with layer = depth, of the heads) from dL/doutput, masked by the ReLU
// that made that input.
void backward_hidden(const DeviceLayout& layout, int layer, const std::byte* weights,
                     const Activations& activations, const Segment& segment, const std::byte* gradient,
                     std::byte* grad_input);

// Calls f(T{}) with the type of the hidden values.
template <class F>
void with_number(const DeviceLayout& layout, F&& f) {
  if (layout.hidden == DType::bf16) {
    f(Bf16{});
  } else {
    f(float{});
  }
}

// The precision that the device computes with.
Precision precision_on_device(const Field& field, Precision wanted);

void forward(const Field& field, const Tensor<float>& points, float time, Precision precision,
             Tensor<float>& output, Saved* saved);
void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field);

}  // namespace traceflow::field::device

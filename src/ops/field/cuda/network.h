#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/tensor.h"
#include "math/bf16.h"
#include "ops/field/field.h"
#include "ops/field/network.h"
#include "primitives/gemm.h"

// How the CUDA device sees a network (method §1.2). Points go through all layers in segments, whose hidden
// values of two layers stay in a large device's second-level cache. The encoding and the hidden values before
// the skip stand side by side in the rows of one matrix, so that each layer is one product.
namespace traceflow::field::device {

// Hidden values of a layer in a segment. Tests make it small.
inline int64_t segment_values = int64_t{1} << 23;

struct DeviceLayout : Layout {
  DeviceLayout(const Field& field, Precision precision, int64_t count);

  int64_t points;
  int64_t segment_rows;  // points in a segment
  int parts;             // numbers for each of the encoding (cuda/kernels.h)
  int64_t number_bytes;

  int64_t segments() const { return (points + segment_rows - 1) / segment_rows; }
  // Points in a segment, and rows with padding: few different numbers, so that few products are planned.
  int64_t points_in(int64_t segment) const;
  int64_t rows_in(int64_t segment) const;

  // Columns of the matrix of the encoding and, with a skip, the hidden values before it.
  int64_t wide_columns() const { return int64_t{parts} * padded_encoding + (skip > 0 ? width : 0); }
  bool ends_wide(int layer) const { return skip > 0 && layer == skip - 1; }
  int64_t output_stride(int layer) const { return ends_wide(layer) ? wide_columns() : width; }
  int64_t input_columns(int layer) const {
    return (sees_encoding(layer) ? parts * padded_encoding : 0) + (layer > 0 ? width : 0);
  }
  int64_t input_stride(int layer) const { return sees_encoding(layer) ? wide_columns() : width; }
  // The encoding's first part is the second once more, and has no gradient of its own.
  int64_t gradient_column(int layer) const {
    return sees_encoding(layer) && parts == 3 ? padded_encoding : 0;
  }
  int64_t gradient_columns(int layer) const { return input_columns(layer) - gradient_column(layer); }
  int64_t mask_stride() const { return (width + 127) / 128 * 128; }  // bits
};

// A part of a device's memory that is shared out.
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

// Where the parts of a segment's activations stand.
struct Activations {
  // keep_all: else the layers take turns in two places, but for those that must not.
  Activations(const DeviceLayout& layout, bool keep_all);

  std::byte* output(const DeviceLayout& layout, int layer, std::byte* segment) const;
  std::byte* input(const DeviceLayout& layout, int layer, std::byte* segment) const {
    return layout.sees_encoding(layer) ? segment : output(layout, layer - 1, segment);
  }
  std::byte* mask(int layer, std::byte* segment) const { return segment + masks + layer * mask_bytes; }

  bool keep_all;
  int64_t hidden = 0, hidden_bytes = 0;  // behind the wide matrix, which stands first
  int64_t masks = 0, mask_bytes = 0;
  int64_t bytes = 0;
};

// Where the weights stand as the products read them.
struct PackedWeights {
  explicit PackedWeights(const DeviceLayout& layout);

  std::vector<int64_t> weight, bias;  // layer, the heads last
  int64_t bytes = 0;
};
void pack_weights(const DeviceLayout& layout, const Field& field, float time, Tensor<std::byte>& packed);

// A segment on its way through the layers.
struct Segment {
  int64_t count;  // points in it
  int64_t rows;   // with padding
  const float* points;
  std::byte* memory;
  bool masks;  // ReLUs leave masks for backward
};

// Memory for the activations of a segment that are not kept, until the next segment; for either pass.
Tensor<std::byte>& passing_memory();

// Whether the library can write and read the masks of all layers, so that backward need not read the
// activations themselves.
bool masks_supported(const DeviceLayout& layout, int64_t rows);

// Fills the encoding and the hidden values of all layers of a segment.
void forward_hidden(const DeviceLayout& layout, const std::byte* weights, const Activations& activations,
                    const Segment& segment);

// dL/dinput of a layer (or, with layer = depth, of the heads), masked by the ReLU that made that input, from
// dL/doutput.
void backward_hidden(const DeviceLayout& layout, int layer, const std::byte* weights,
                     const Activations& activations, const Segment& segment, const std::byte* gradient,
                     std::byte* grad_input);

// f(T{}) with the hidden values' number type.
template <class F>
void with_number(const DeviceLayout& layout, F&& f) {
  if (layout.hidden == DType::bf16) {
    f(Bf16{});
  } else {
    f(float{});
  }
}

// The number type that the device computes with.
Precision precision_on_device(const Field& field, Precision wanted);

void forward(const Field& field, const Tensor<float>& points, float time, Precision precision,
             Tensor<float>& output, Saved* saved);
void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field);

}  // namespace traceflow::field::device

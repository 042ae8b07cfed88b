#include "ops/field/cuda/network.h"

#include <algorithm>

#include "base/parallel.h"
#include "ops/field/cuda/kernels.h"

namespace traceflow::field::device {

namespace {

using traceflow::cuda::GemmAddresses;
using traceflow::cuda::GemmDescription;
using traceflow::cuda::Mask;

// Rows are padded to a multiple of this.
int64_t row_quantum(int64_t points) { return points > 8192 ? 1024 : 128; }
int64_t rounded_up(int64_t n, int64_t to) { return (n + to - 1) / to * to; }

// The product of a layer: its input times its transposed weights.
GemmDescription forward_gemm(const DeviceLayout& l, int layer, int64_t rows, bool masks) {
  return {.m = rows,
          .k = l.input_columns(layer),
          .n = l.width,
          .transposed_b = true,
          .stride_a = l.input_stride(layer),
          .stride_b = l.input_columns(layer),
          .stride_c = l.output_stride(layer),
          .operands = l.hidden,
          .result = l.hidden,
          .bias = !l.sees_encoding(layer),
          .relu = true,
          .mask = masks ? Mask::written : Mask::none,
          .mask_stride = masks ? l.mask_stride() : 0};
}

// The product that turns the gradient of the output of a layer, or of the heads, into that of its hidden
// input.
GemmDescription backward_gemm(const DeviceLayout& l, int layer, int64_t rows, bool masks) {
  const int64_t outputs = layer == l.depth ? l.padded_outputs : l.width;
  return {.m = rows,
          .k = outputs,
          .n = l.width,
          .stride_a = outputs,
          .stride_b = l.input_columns(layer),
          .stride_c = l.width,
          .operands = l.hidden,
          .result = l.hidden,
          .mask = masks ? Mask::read : Mask::none,
          .mask_stride = masks ? l.mask_stride() : 0};
}

// The product without its epilogue, for when the library does not support them together.
GemmDescription without_epilogue(GemmDescription gemm) {
  gemm.bias = gemm.relu = false;
  gemm.mask = Mask::none;
  gemm.mask_stride = 0;
  return gemm;
}

template <class T>
void encode(const DeviceLayout& layout, const Segment& segment) {
  parallel_for(Device::cuda, "field: encode", segment.rows * layout.padded_encoding,
               Encode<T>{segment.points, segment.count, layout.padded_encoding, layout.encoding,
                         layout.wide_columns(), reinterpret_cast<T*>(segment.memory)});
}

}  // namespace

DeviceLayout::DeviceLayout(const Field& field, Precision precision, int64_t count)
    : Layout(field, precision),
      points(count),
      segment_rows(rounded_up(std::max<int64_t>(segment_values / width, 1), row_quantum(count))),
      parts(hidden == DType::bf16 ? 3 : 1),
      number_bytes(hidden == DType::bf16 ? 2 : 4) {}

int64_t DeviceLayout::points_in(int64_t segment) const {
  return std::min(segment_rows, points - segment * segment_rows);
}
int64_t DeviceLayout::rows_in(int64_t segment) const {
  return rounded_up(points_in(segment), row_quantum(points));
}

Activations::Activations(const DeviceLayout& layout, bool all) : keep_all(all) {
  const int64_t rows = layout.rows_in(0);
  Share share;
  share.take(rows * layout.wide_columns() * layout.number_bytes);
  hidden_bytes = rows * layout.width * layout.number_bytes;
  const int places = keep_all ? layout.depth - (layout.skip > 0 ? 1 : 0) : std::min(layout.depth, 2);
  hidden = share.take(places * hidden_bytes);
  mask_bytes = rows * layout.mask_stride() / 8;
  masks = share.take(keep_all ? layout.depth * mask_bytes : 0);
  bytes = share.size();
}

std::byte* Activations::output(const DeviceLayout& layout, int layer, std::byte* segment) const {
  if (layout.ends_wide(layer)) {
    return segment + int64_t{layout.parts} * layout.padded_encoding * layout.number_bytes;
  }
  const int behind_wide = layout.skip > 0 && layer >= layout.skip ? 1 : 0;
  return segment + hidden + (keep_all ? layer - behind_wide : layer % 2) * hidden_bytes;
}

PackedWeights::PackedWeights(const DeviceLayout& layout) {
  Share share;
  for (int layer = 0; layer <= layout.depth; ++layer) {
    const int64_t outputs = layer == layout.depth ? layout.padded_outputs : layout.width;
    weight.push_back(share.take(outputs * layout.input_columns(layer) * layout.number_bytes));
    bias.push_back(share.take(layout.width * layout.number_bytes));
  }
  bytes = share.size();
}

void pack_weights(const DeviceLayout& layout, const Field& field, float time, Tensor<std::byte>& packed) {
  const PackedWeights places(layout);
  packed.place(Device::cuda).resize({places.bytes});
  with_number(layout, [&]<class T>(T) {
    Pack<T> step{.encoding = layout.encoding, .time_encoding = layout.time_encoding};
    const std::vector<double> encoded_time = encode_time(layout, time);
    std::transform(encoded_time.begin(), encoded_time.end(), step.time,
                   [](double t) { return static_cast<float>(t); });
    int64_t end = 0;
    for (int layer = 0; layer <= layout.depth; ++layer) {
      const bool heads = layer == layout.depth;
      const bool has_bias = !heads && !layout.sees_encoding(layer);
      end +=
          (heads ? layout.padded_outputs : layout.width) * (layout.input_columns(layer) + (has_bias ? 1 : 0));
      step.layer[layer] = {
          .weight = heads ? field.head_weight.data() : field.weight[layer].data(),
          .bias = heads ? nullptr : field.bias[layer].data(),
          .to = reinterpret_cast<T*>(packed.data() + places.weight[layer]),
          .to_bias = has_bias ? reinterpret_cast<T*>(packed.data() + places.bias[layer]) : nullptr,
          .end = end,
          .encoding_columns = layout.sees_encoding(layer) ? layout.padded_encoding : 0,
          .hidden = layer > 0 ? layout.width : 0,
          .rows = heads ? layout.outputs : layout.width};
    }
    parallel_for(Device::cuda, "field: weights", end, step);
  });
}

Tensor<std::byte>& passing_memory() {
  thread_local Tensor<std::byte> memory;
  memory.place(Device::cuda);
  return memory;
}

bool masks_supported(const DeviceLayout& layout, int64_t rows) {
  for (int layer = 0; layer < layout.depth; ++layer) {
    if (!traceflow::cuda::supported(forward_gemm(layout, layer, rows, true)) ||
        !traceflow::cuda::supported(backward_gemm(layout, layer + 1, rows, true))) {
      return false;
    }
  }
  return true;
}

void forward_hidden(const DeviceLayout& layout, const std::byte* weights, const Activations& activations,
                    const Segment& segment) {
  const PackedWeights places(layout);
  with_number(layout, [&]<class T>(T) {
    encode<T>(layout, segment);
    for (int layer = 0; layer < layout.depth; ++layer) {
      const GemmDescription gemm = forward_gemm(layout, layer, segment.rows, segment.masks);
      const GemmAddresses at{
          .a = activations.input(layout, layer, segment.memory),
          .b = weights + places.weight[layer],
          .c = activations.output(layout, layer, segment.memory),
          .bias = gemm.bias ? weights + places.bias[layer] : nullptr,
          .mask = segment.masks ? activations.mask(layer, segment.memory) : nullptr,
      };
      if (traceflow::cuda::supported(gemm)) {
        traceflow::cuda::multiply(gemm, at);
        continue;
      }
      traceflow::cuda::multiply(without_epilogue(gemm), at);
      const int groups = layout.width / Numbers<T>::count;
      parallel_for(
          Device::cuda, "field: bias and ReLU", segment.rows * groups,
          AddBiasAndRelu<T>{static_cast<T*>(at.c), static_cast<const T*>(at.bias), groups, gemm.stride_c});
    }
  });
}

void backward_hidden(const DeviceLayout& layout, int layer, const std::byte* weights,
                     const Activations& activations, const Segment& segment, const std::byte* gradient,
                     std::byte* grad_input) {
  const int64_t hidden_column = layout.sees_encoding(layer) ? layout.parts * layout.padded_encoding : 0;
  const GemmDescription gemm = backward_gemm(layout, layer, segment.rows, segment.masks);
  traceflow::cuda::multiply(
      gemm, {.a = gradient,
             .b = weights + PackedWeights(layout).weight[layer] + hidden_column * layout.number_bytes,
             .c = grad_input,
             .mask = segment.masks ? activations.mask(layer - 1, segment.memory) : nullptr});
  if (segment.masks) return;
  with_number(layout, [&]<class T>(T) {
    const std::byte* const input = activations.output(layout, layer - 1, segment.memory);
    const int groups = layout.width / Numbers<T>::count;
    parallel_for(Device::cuda, "field: ReLU backward", segment.rows * groups,
                 MaskByActivation<T>{reinterpret_cast<T*>(grad_input), reinterpret_cast<const T*>(input),
                                     groups, layout.output_stride(layer - 1)});
  });
}

Precision precision_on_device(const Field& field, Precision wanted) {
  if (wanted == Precision::fp32) return wanted;
  const DeviceLayout layout(field, wanted, 1024);
  const GemmDescription gemm = forward_gemm(layout, 0, 1024, false);
  return traceflow::cuda::supported(without_epilogue(gemm)) ? wanted : Precision::fp32;
}

}  // namespace traceflow::field::device

#include <algorithm>

#include "base/parallel.h"
#include "ops/field/cuda/column_sums.h"
#include "ops/field/cuda/kernels.h"
#include "ops/field/cuda/network.h"
#include "ops/field/field.h"

namespace traceflow::field::device {

namespace {

// Offset of each parameter's gradient in the sums. The points of every segment are divided among slots, each
// a product of its own, so that small gradients of many points keep the whole device busy. The slots are
// added in order. Their number depends only on the points.
struct Sums {
  explicit Sums(const DeviceLayout& layout) {
    while (slots < 32 && slots * 1024 <= layout.rows_in(0)) slots *= 2;
    bias_slots = 4 * slots;
    for (int layer = 0; layer <= layout.depth; ++layer) {
      const int64_t outputs = layer == layout.depth ? layout.padded_outputs : layout.width;
      weight.push_back(slot_size);
      slot_size += outputs * layout.gradient_columns(layer);
      bias.push_back(bias_slot_size);
      bias_slot_size += outputs;
    }
  }
  int64_t size() const { return slots * slot_size + bias_slots * bias_slot_size; }
  const float* bias_sums(const float* sums, int layer) const {
    return sums + slots * slot_size + bias[layer];
  }
  float* bias_sums(float* sums, int layer) const { return sums + slots * slot_size + bias[layer]; }

  int slots = 1, bias_slots = 0;
  std::vector<int64_t> weight, bias;  // per layer, the heads last; offsets in a slot
  int64_t slot_size = 0, bias_slot_size = 0;
};

// What every segment of a backward pass reads, and the sums that it adds to.
struct Pass {
  const DeviceLayout& layout;
  const Activations& activations;
  const Sums& sums;
  const std::byte* weights;
  float* values;  // the sums themselves
};

// Working memory, kept between calls.
struct Scratch {
  void resize(const DeviceLayout& layout, const Sums& sums) {
    const int64_t rows = layout.rows_in(0);
    for (Tensor<std::byte>& t : gradient) {
      t.place(Device::cuda).resize({rows * layout.width * layout.number_bytes});
    }
    grad_output.place(Device::cuda).resize({rows * layout.padded_outputs * layout.number_bytes});
    exact_grad_output.place(Device::cuda).resize({rows, layout.padded_outputs});
    values.place(Device::cuda).reset({sums.size()});
  }
  Tensor<std::byte> gradient[2], grad_output;
  Tensor<float> exact_grad_output, values;
};

// Adds the gradient of the weights of a layer, or of the heads, given the gradient of its output.
void add_weight_gradient(const Pass& pass, int layer, const Segment& segment, const std::byte* gradient) {
  const DeviceLayout& layout = pass.layout;
  const int64_t outputs = layer == layout.depth ? layout.padded_outputs : layout.width;
  const int64_t slot_rows = segment.rows / pass.sums.slots;
  const int64_t stride = layer == layout.depth ? layout.width : layout.input_stride(layer);
  const std::byte* const input = pass.activations.input(layout, layer, segment.memory);
  traceflow::cuda::multiply({.m = outputs,
                             .k = slot_rows,
                             .n = layout.gradient_columns(layer),
                             .transposed_a = true,
                             .stride_a = outputs,
                             .stride_b = stride,
                             .stride_c = layout.gradient_columns(layer),
                             .operands = layout.hidden,
                             .result = DType::fp32,
                             .accumulate = true,
                             .batches = pass.sums.slots,
                             .batch_a = slot_rows * outputs,
                             .batch_b = slot_rows * stride,
                             .batch_c = pass.sums.slot_size},
                            {.a = gradient,
                             .b = input + layout.gradient_column(layer) * layout.number_bytes,
                             .c = pass.values + pass.sums.weight[layer]});
}

// Adds the column sums of a gradient to those of a layer's bias.
template <class T>
void add_bias_gradient(const Pass& pass, int layer, const Segment& segment, const T* gradient) {
  const int outputs = layer == pass.layout.depth ? pass.layout.padded_outputs : pass.layout.width;
  cuda::add_column_sums(gradient, segment.rows, outputs, pass.sums.bias_slots,
                        pass.sums.bias_sums(pass.values, layer), pass.sums.bias_slot_size);
}

// Adds one segment's gradients to the sums, from the heads to the first layer.
void backward_segment(const Pass& pass, const Segment& segment, const float* grad_output, Scratch& scratch) {
  const DeviceLayout& layout = pass.layout;
  with_number(layout, [&]<class T>(T) {
    parallel_for(
        Device::cuda, "field: gradient of the output", segment.rows,
        LoadGradient<T>{segment.points, grad_output, segment.count, layout.outputs, layout.padded_outputs,
                        reinterpret_cast<T*>(scratch.grad_output.data()), scratch.exact_grad_output.data()});
    add_bias_gradient(pass, layout.depth, segment, scratch.exact_grad_output.data());
    const std::byte* gradient = scratch.grad_output.data();
    for (int layer = layout.depth; layer >= 0; --layer) {
      add_weight_gradient(pass, layer, segment, gradient);
      // In layers that see the encoding the bias is one of the weights.
      if (layer < layout.depth && !layout.sees_encoding(layer)) {
        add_bias_gradient(pass, layer, segment, reinterpret_cast<const T*>(gradient));
      }
      if (layer == 0) break;
      std::byte* const next = scratch.gradient[layer % 2].data();
      backward_hidden(layout, layer, pass.weights, pass.activations, segment, gradient, next);
      gradient = next;
    }
  });
}

void add_slots(const Pass& pass, float time, Field& grad_field) {
  const DeviceLayout& layout = pass.layout;
  AddSlots step{.parts = layout.parts == 3 ? 2 : 1,
                .encoding = layout.encoding,
                .time_encoding = layout.time_encoding,
                .slots = pass.sums.slots,
                .bias_slots = pass.sums.bias_slots,
                .slot_stride = pass.sums.slot_size,
                .bias_slot_stride = pass.sums.bias_slot_size};
  const std::vector<double> encoded_time = encode_time(layout, time);
  std::transform(encoded_time.begin(), encoded_time.end(), step.time,
                 [](double t) { return static_cast<float>(t); });
  int64_t end = 0;
  for (int layer = 0; layer <= layout.depth; ++layer) {
    const bool heads = layer == layout.depth;
    const bool sees_encoding = layout.sees_encoding(layer);
    Tensor<float>& weight = heads ? grad_field.head_weight : grad_field.weight[layer];
    Tensor<float>& bias = heads ? grad_field.head_bias : grad_field.bias[layer];
    end += weight.size() + bias.size();
    step.layer[layer] = {.grad_weight = weight.data(),
                         .grad_bias = bias.data(),
                         .sums = pass.values + pass.sums.weight[layer],
                         .bias_sums = sees_encoding ? nullptr : pass.sums.bias_sums(pass.values, layer),
                         .end = end,
                         .encoding_columns = sees_encoding ? layout.padded_encoding : 0,
                         .hidden = layer > 0 ? layout.width : 0};
  }
  parallel_for(Device::cuda, "field: add gradients", end, step);
}

}  // namespace

void backward(const Field& field, const Tensor<float>& points, float time, const Saved& saved,
              const Tensor<float>& grad_output, Field& grad_field) {
  thread_local Scratch scratch;
  if (points.empty()) return;
  const DeviceLayout layout(field, saved.precision, points.dim(0));
  require(grad_output.shape() == Shape({layout.points, layout.outputs}),
          "grad_output has the shape of the output", grad_output.shape().to_string());
  const Activations activations(layout, true);
  const Sums sums(layout);
  scratch.resize(layout, sums);
  const Pass pass{layout, activations, sums, saved.weights.data(), scratch.values.data()};

  for (int64_t s = 0; s < layout.segments(); ++s) {
    const bool kept = s < saved.kept_blocks;
    if (!kept) passing_memory().resize({activations.bytes});
    const int64_t rows = layout.rows_in(s);
    const Segment segment{
        .count = layout.points_in(s),
        .rows = rows,
        .points = points.row(s * layout.segment_rows),
        // Kept activations are only read.
        .memory = kept ? const_cast<std::byte*>(saved.activations.data()) + s * activations.bytes
                       : passing_memory().data(),
        .masks = masks_supported(layout, rows)};
    if (!kept) forward_hidden(layout, saved.weights.data(), activations, segment);
    backward_segment(pass, segment, grad_output.row(s * layout.segment_rows), scratch);
  }
  add_slots(pass, time, grad_field);
}

}  // namespace traceflow::field::device

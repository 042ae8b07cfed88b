#pragma once

#include <cstdint>

#include "math/bf16.h"
#include "math/encoding.h"
#include "ops/field/field_kernels.h"

// The element-wise steps between the network's products on the CUDA device. T is the type of the hidden
// values. With bf16 a number e of the encoding is stored as three, [h, h, l]: h is its nearest bf16 and l
// that of the remainder. Its weight w is stored as [l, h, h], so that the product e·w is within 2⁻¹⁶ of that
// in fp32. The first padding column of the encoding is 1: its weight is the bias, and that column of the
// weight's gradient is the bias's gradient.
namespace traceflow::field::device {

inline constexpr int max_layers = 32;
inline constexpr int max_time_encoding = 33;

// What a thread reads or writes at once. Every matrix row is aligned to it and holds a whole number of them.
template <class T>
struct alignas(16) Numbers {
  static constexpr int count = 16 / sizeof(T);
  T value[count];

  TRACEFLOW_HD static Numbers& at(T* address) { return *reinterpret_cast<Numbers*>(address); }
  TRACEFLOW_HD static const Numbers& at(const T* address) {
    return *reinterpret_cast<const Numbers*>(address);
  }
};

// Writes γ(points) into rows of `parts` times `columns` numbers. i: (row, column).
template <class T>
struct Encode {
  const float* points;
  int64_t
      count;  // rows beyond are filled like those of points that are not evaluated, which enter as the origin
  int columns, encoding;
  int64_t stride;
  T* rows;

  TRACEFLOW_HD float value(int64_t row, int column) const {
    if (column >= encoding) return column == encoding ? 1.0F : 0.0F;
    const float* const point = points + 3 * row;
    const bool enters = row < count && evaluated(point);
    if (column < 3) return enters ? point[column] : 0.0F;
    const int wave = (column - 3) / 3;  // sin 2⁰, cos 2⁰, sin 2¹, …
    const auto frequency = static_cast<float>(1 << wave / 2);
    return sin_of_turns(turns_of(enters ? point[column % 3] : 0.0F), frequency, wave % 2 == 0 ? 0.0F : 0.25F);
  }
  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const auto width = static_cast<uint32_t>(columns);
    const int64_t row = index / width;
    const int column = static_cast<int>(index % width);
    write(value(row, column), column == encoding, rows + row * stride + column);
  }
  TRACEFLOW_HD void write(float e, bool, float* to) const { *to = e; }
  TRACEFLOW_HD void write(float e, bool one, Bf16* to) const {
    const Bf16 high = rounded_to<Bf16>(e);
    to[0] = to[columns] = high;
    to[2 * columns] = one ? high : rounded_to<Bf16>(e - to_float(high));
  }
};

// The weights of one layer, and where the products read them.
template <class T>
struct PackedLayer {
  const float *weight, *bias;
  T* to;                 // width × (parts·encoding columns + hidden), row-major
  T* to_bias;            // width; null if the bias is in the encoding's column
  int64_t end;           // end of its numbers among those of all layers
  int encoding_columns;  // of one part; 0 if the layer does not see the encoding
  int hidden;            // hidden values that the layer sees
  int rows;              // stored rows; rows beyond are zero
};

// Fills the weights of all layers. i: (layer, row, column); the bias is one more column.
template <class T>
struct Pack {
  static constexpr int parts = sizeof(T) == sizeof(float) ? 1 : 3;

  PackedLayer<T> layer[max_layers + 1] = {};  // the heads last
  int encoding, time_encoding;
  float time[max_time_encoding] = {};

  TRACEFLOW_HD void operator()(int64_t i) const {
    int l = 0;
    while (i >= layer[l].end) ++l;
    const PackedLayer<T>& at = layer[l];
    const int columns = parts * at.encoding_columns + at.hidden;
    const auto index = static_cast<uint32_t>(l == 0 ? i : i - layer[l - 1].end);
    const auto row_size = static_cast<uint32_t>(columns + (at.to_bias == nullptr ? 0 : 1));
    const int64_t row = index / row_size;
    const int column = static_cast<int>(index % row_size);
    if (column == columns) {
      store(row < at.rows ? at.bias[row] : 0.0F, at.to_bias[row]);
    } else {
      at.to[row * columns + column] = row < at.rows ? packed(at, row, column) : rounded_to<T>(0.0F);
    }
  }

  TRACEFLOW_HD T packed(const PackedLayer<T>& at, int64_t row, int column) const {
    const int time_columns = at.encoding_columns == 0 ? 0 : time_encoding;
    const int encoding_columns = at.encoding_columns == 0 ? 0 : encoding;
    const float* const weight = at.weight + row * (encoding_columns + time_columns + at.hidden);
    const int hidden = column - parts * at.encoding_columns;
    if (hidden >= 0) return rounded_to<T>(weight[encoding_columns + time_columns + hidden]);
    const int part = column / at.encoding_columns;
    const int e = column % at.encoding_columns;
    if (e > encoding) return rounded_to<T>(0.0F);
    return e < encoding ? of_weight(weight[e], part) : of_bias(bias_at_time(at, row, weight), part);
  }
  // bias + W_t γ(t). W_t is the columns of the time's encoding, which is the same for every point.
  TRACEFLOW_HD float bias_at_time(const PackedLayer<T>& at, int64_t row, const float* weight) const {
    double sum = static_cast<double>(at.bias[row]);
    for (int j = 0; j < time_encoding; ++j) {
      sum += static_cast<double>(weight[encoding + j]) * static_cast<double>(time[j]);
    }
    return static_cast<float>(sum);
  }
  TRACEFLOW_HD static T of_weight(float w, int part) {
    const T high = rounded_to<T>(w);
    return parts == 3 && part == 0 ? rounded_to<T>(w - to_float(high)) : high;
  }
  // All three columns are 1, so that the three bf16 weights together hold the bias more exactly.
  TRACEFLOW_HD static T of_bias(float b, int part) {
    const T first = rounded_to<T>(b);
    if (parts == 1 || part == 1) return first;
    const T second = rounded_to<T>(b - to_float(first));
    return part == 0 ? second : rounded_to<T>(b - to_float(first) - to_float(second));
  }
};

// Replaces a product's bias and ReLU where the library does not support them. i: (row, group).
template <class T>
struct AddBiasAndRelu {
  T* values;
  const T* bias;  // null: none
  int groups;     // per row
  int64_t stride;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i), width = static_cast<uint32_t>(groups);
    const int64_t column = int64_t{index % width} * Numbers<T>::count;
    Numbers<T>& place = Numbers<T>::at(values + int64_t{index / width} * stride + column);
    Numbers<T> group = place;
    for (int k = 0; k < group.count; ++k) {
      const float sum = to_float(group.value[k]) + (bias == nullptr ? 0.0F : to_float(bias[column + k]));
      store(sum > 0 ? sum : 0.0F, group.value[k]);
    }
    place = group;
  }
};

// Replaces the derivative of that ReLU: gradient = 0 unless the activation is > 0. i: (row, group).
template <class T>
struct MaskByActivation {
  T* gradient;  // dense
  const T* activation;
  int groups;      // per row
  int64_t stride;  // of the activation

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i), width = static_cast<uint32_t>(groups);
    const int64_t column = int64_t{index % width} * Numbers<T>::count;
    const Numbers<T> made = Numbers<T>::at(activation + int64_t{index / width} * stride + column);
    Numbers<T>& place = Numbers<T>::at(gradient + i * Numbers<T>::count);
    Numbers<T> group = place;
    for (int k = 0; k < group.count; ++k) {
      if (!(to_float(made.value[k]) > 0)) store(0.0F, group.value[k]);
    }
    place = group;
  }
};

// Adds the heads' bias to their sums and writes the output rows. i: (point, output).
struct FinishOutput {
  const float *points, *sums, *bias;
  int outputs, padded_outputs;
  float* output;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const auto index = static_cast<uint32_t>(i);
    const auto width = static_cast<uint32_t>(outputs);
    const int64_t row = index / width;
    const uint32_t column = index % width;
    output[i] = evaluated(points + 3 * row) ? sums[row * padded_outputs + column] + bias[column] : 0.0F;
  }
};

// Copies the valid rows of dL/doutput, padded with zeros: in the format of the products, and in that of the
// sums of the bias's gradient. i: row.
template <class T>
struct LoadGradient {
  const float *points, *gradient;
  int64_t count;
  int outputs, padded_outputs;
  T* to;
  float* exact;

  TRACEFLOW_HD void operator()(int64_t i) const {
    const float* const from = gradient + i * outputs;
    bool counts = i < count && evaluated(points + 3 * i);
    for (int k = 0; counts && k < outputs; ++k) counts = from[k] - from[k] == 0.0F;  // finite
    for (int k = 0; k < padded_outputs; ++k) {
      const float g = counts && k < outputs ? from[k] : 0.0F;
      exact[i * padded_outputs + k] = g;
      store(g, to[i * padded_outputs + k]);
    }
  }
};

// The sums of one layer's gradients, and what they are added to.
struct SummedLayer {
  float *grad_weight, *grad_bias;
  const float* sums;       // slots of rows × (high, low, hidden columns)
  const float* bias_sums;  // slots of rows; null if the bias's gradient is in the encoding's column
  int64_t end;             // end of its parameters among those of all layers
  int encoding_columns;    // of one part; 0 if the layer does not see the encoding
  int hidden;
};

// Adds the slots of every parameter, in order, to its gradient. i: (layer, row, column); the bias is one more
// column. The gradient of the time's columns is (dL/dbias) γ(t).
struct AddSlots {
  SummedLayer layer[max_layers + 1] = {};  // the heads last
  int parts;                               // of the encoding in the sums: 1, or 2 (high, low)
  int encoding, time_encoding;
  float time[max_time_encoding] = {};
  int slots, bias_slots;
  int64_t slot_stride, bias_slot_stride;

  TRACEFLOW_HD static float sum(const float* from, int slots, int64_t stride) {
    float total = 0;
    for (int s = 0; s < slots; ++s) total += from[s * stride];
    return total;
  }
  TRACEFLOW_HD void operator()(int64_t i) const {
    int l = 0;
    while (i >= layer[l].end) ++l;
    const SummedLayer& at = layer[l];
    const bool sees = at.encoding_columns > 0;
    const int time_column = sees ? encoding : 0;
    const int hidden_column = sees ? encoding + time_encoding : 0;
    const int inputs = hidden_column + at.hidden;
    const auto index = static_cast<uint32_t>(l == 0 ? i : i - layer[l - 1].end);
    const auto row_size = static_cast<uint32_t>(inputs + 1);
    const int64_t row = index / row_size;
    const int column = static_cast<int>(index % row_size);

    const float* const sums = at.sums + row * (parts * at.encoding_columns + at.hidden);
    const auto column_sum = [&](int c) { return sum(sums + c, slots, slot_stride); };
    if (column == inputs) {
      at.grad_bias[row] +=
          sees ? column_sum(encoding) : sum(at.bias_sums + row, bias_slots, bias_slot_stride);
      return;
    }
    float& gradient = at.grad_weight[row * inputs + column];
    if (column >= hidden_column) {
      gradient += column_sum(parts * at.encoding_columns + column - hidden_column);
    } else if (column >= time_column) {
      gradient += column_sum(encoding) * time[column - time_column];
    } else {
      gradient += column_sum(column) + (parts == 2 ? column_sum(at.encoding_columns + column) : 0.0F);
    }
  }
};

}  // namespace traceflow::field::device

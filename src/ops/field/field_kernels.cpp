#include "ops/field/field_kernels.h"

#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ops/field/field_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef TRACEFLOW_FIELD_KERNELS_ONCE
#define TRACEFLOW_FIELD_KERNELS_ONCE
namespace traceflow::field {

inline constexpr int64_t max_encoding_columns = 112;  // 3·(1 + 2·16), rounded up

// Column j of an encoding is sin(2π·(scale[j]·x/2π + phase[j])) of one coordinate; the scales of the others
// are 0.
struct EncodingTable {
  std::array<std::array<float, max_encoding_columns>, 3> scale{};
  std::array<float, max_encoding_columns> phase{};
};

}  // namespace traceflow::field
#endif

HWY_BEFORE_NAMESPACE();
namespace traceflow::field::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Floats>;

// sin(2πr) for |r| ≤ 1/2: folded to a quarter turn, then the series up to θ¹¹; error below 1e-7.
HWY_INLINE Vector sin_turns(Floats d, Vector r) {
  const Vector magnitude = hn::Abs(r);
  const Vector folded = hn::Min(magnitude, hn::Sub(hn::Set(d, 0.5F), magnitude));
  const Vector angle = hn::Mul(hn::CopySign(folded, r), hn::Set(d, 6.28318530717958648F));
  const Vector square = hn::Mul(angle, angle);
  Vector series = hn::Set(d, -2.50521083854417188e-8F);
  series = hn::MulAdd(series, square, hn::Set(d, 2.75573192239858907e-6F));
  series = hn::MulAdd(series, square, hn::Set(d, -1.98412698412698413e-4F));
  series = hn::MulAdd(series, square, hn::Set(d, 8.33333333333333333e-3F));
  series = hn::MulAdd(series, square, hn::Set(d, -1.66666666666666667e-1F));
  return hn::MulAdd(hn::Mul(series, square), angle, angle);
}

// The columns of one point's encoding. The point is given in turns, x/2π = high + low. Scaling by powers of
// two has no error in either, so that removing the whole turns of the high part is exact, however many there
// are.
HWY_INLINE void encode_row(const float* high, const float* low, const EncodingTable& table, int64_t columns,
                           float* row) {
  const Floats d;
  for (int64_t j = 0; j < columns; j += static_cast<int64_t>(hn::Lanes(d))) {
    Vector turns = hn::Zero(d);
    Vector rest = hn::LoadU(d, &table.phase[static_cast<size_t>(j)]);
    for (size_t c = 0; c < 3; ++c) {
      const Vector scale = hn::LoadU(d, &table.scale[c][static_cast<size_t>(j)]);
      turns = hn::MulAdd(hn::Set(d, high[c]), scale, turns);
      rest = hn::MulAdd(hn::Set(d, low[c]), scale, rest);
    }
    const Vector fraction = hn::Add(hn::Sub(turns, hn::Round(turns)), rest);
    hn::StoreU(sin_turns(d, hn::Sub(fraction, hn::Round(fraction))), d, row + j);
  }
}

void encode_rows(const float* points, int64_t count, int64_t rows, const EncodingTable& table,
                 int64_t columns, float* encoding) {
  constexpr double turns_per_radian = 0.15915494309189533577;
  for (int64_t i = 0; i < rows; ++i) {
    const bool enters = i < count && evaluated(points + 3 * i);
    float point[3], high[3], low[3];
    for (int c = 0; c < 3; ++c) {
      point[c] = enters ? points[3 * i + c] : 0.0F;
      const double turns = static_cast<double>(point[c]) * turns_per_radian;
      high[c] = static_cast<float>(turns);
      low[c] = static_cast<float>(turns - static_cast<double>(high[c]));
    }
    float* row = encoding + i * columns;
    encode_row(high, low, table, columns, row);
    for (int c = 0; c < 3; ++c) row[c] = point[c];
  }
}

HWY_INLINE hn::Vec<hn::Rebind<uint16_t, Floats>> nearest_bf16(Vector v) {
  const hn::RebindToUnsigned<Floats> bits;
  const auto u = hn::BitCast(bits, v);
  const auto odd = hn::And(hn::ShiftRight<16>(u), hn::Set(bits, 1U));
  const auto rounded = hn::ShiftRight<16>(hn::Add(u, hn::Add(odd, hn::Set(bits, 0x7FFFU))));
  return hn::DemoteTo(hn::Rebind<uint16_t, Floats>(), hn::BitCast(hn::RebindToSigned<Floats>(), rounded));
}

void round_values(const float* from, int64_t count, uint16_t* to) {
  const Floats d;
  const hn::Rebind<uint16_t, Floats> half;
  for (int64_t i = 0; i < count; i += static_cast<int64_t>(hn::Lanes(d))) {
    hn::StoreU(nearest_bf16(hn::LoadU(d, from + i)), half, to + i);
  }
}

HWY_INLINE hn::Mask<Floats> is_positive(Floats d, const float* activation) {
  return hn::Gt(hn::LoadU(d, activation), hn::Zero(d));
}
// The bits of a bf16, read as an integer, have the sign of the number.
HWY_INLINE hn::Mask<Floats> is_positive(Floats d, const int16_t* activation) {
  const hn::RebindToSigned<Floats> integers;
  const auto bits = hn::PromoteTo(integers, hn::LoadU(hn::Rebind<int16_t, Floats>(), activation));
  return hn::RebindMask(d, hn::Gt(bits, hn::Zero(integers)));
}

// Masks a strip of `vectors` vectors' width in all rows, with the column sums in registers.
template <int vectors, class Activation>
HWY_INLINE void mask_strip(const Activation* activation, int64_t rows, int64_t columns, float* gradient,
                           uint16_t* rounded, float* column_sum) {
  const Floats d;
  const hn::Rebind<uint16_t, Floats> half;
  const auto lanes = static_cast<int64_t>(hn::Lanes(d));
  Vector sums[vectors];
  for (int v = 0; v < vectors; ++v) sums[v] = hn::Zero(d);
  for (int64_t i = 0; i < rows * columns; i += columns) {
    for (int v = 0; v < vectors; ++v) {
      const int64_t at = i + v * lanes;
      const Vector masked = hn::IfThenElseZero(is_positive(d, activation + at), hn::LoadU(d, gradient + at));
      hn::StoreU(masked, d, gradient + at);
      if (rounded != nullptr) hn::StoreU(nearest_bf16(masked), half, rounded + at);
      sums[v] = hn::Add(sums[v], masked);
    }
  }
  for (int v = 0; v < vectors; ++v) {
    float* sum = column_sum + v * lanes;
    hn::StoreU(hn::Add(hn::LoadU(d, sum), sums[v]), d, sum);
  }
}

template <class Activation>
void mask_columns(const Activation* activation, int64_t rows, int64_t columns, float* gradient,
                  uint16_t* rounded, float* column_sum) {
  const auto lanes = static_cast<int64_t>(hn::Lanes(Floats()));
  int64_t j = 0;
  const auto rounded_at = [&](int64_t at) { return rounded == nullptr ? nullptr : rounded + at; };
  for (; j + 4 * lanes <= columns; j += 4 * lanes) {
    mask_strip<4>(activation + j, rows, columns, gradient + j, rounded_at(j), column_sum + j);
  }
  for (; j < columns; j += lanes) {
    mask_strip<1>(activation + j, rows, columns, gradient + j, rounded_at(j), column_sum + j);
  }
}

void mask_fp32(const float* activation, int64_t rows, int64_t columns, float* gradient, float* column_sum) {
  mask_columns(activation, rows, columns, gradient, nullptr, column_sum);
}

void mask_bf16(const int16_t* activation, int64_t rows, int64_t columns, float* gradient, uint16_t* rounded,
               float* column_sum) {
  mask_columns(activation, rows, columns, gradient, rounded, column_sum);
}

void sum_slots(const float* from, int64_t slots, int64_t stride, int64_t count, float* to) {
  const Floats d;
  const auto lanes = static_cast<int64_t>(hn::Lanes(d));
  int64_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    Vector sum = hn::LoadU(d, from + i);
    for (int64_t k = 1; k < slots; ++k) sum = hn::Add(sum, hn::LoadU(d, from + k * stride + i));
    hn::StoreU(hn::Add(hn::LoadU(d, to + i), sum), d, to + i);
  }
  for (; i < count; ++i) {
    float sum = from[i];
    for (int64_t k = 1; k < slots; ++k) sum += from[k * stride + i];
    to[i] += sum;
  }
}

}  // namespace traceflow::field::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace traceflow::field {

HWY_EXPORT(encode_rows);
HWY_EXPORT(round_values);
HWY_EXPORT(mask_fp32);
HWY_EXPORT(mask_bf16);
HWY_EXPORT(sum_slots);

namespace {

EncodingTable make_table(int octaves) {
  EncodingTable table;
  float frequency = 1;
  size_t column = 3;
  for (int octave = 0; octave < octaves; ++octave, frequency *= 2) {
    for (const float phase : {0.0F, 0.25F}) {
      for (size_t coordinate = 0; coordinate < 3; ++coordinate, ++column) {
        table.scale[coordinate][column] = frequency;
        table.phase[column] = phase;
      }
    }
  }
  return table;
}

}  // namespace

void encode_points(const float* points, int64_t count, int64_t rows, int octaves, int64_t columns,
                   float* encoding) {
  HWY_DYNAMIC_DISPATCH(encode_rows)(points, count, rows, make_table(octaves), columns, encoding);
}

void round_to_bf16(const float* from, int64_t count, uint16_t* to) {
  HWY_DYNAMIC_DISPATCH(round_values)(from, count, to);
}

void mask_by_activation(const void* activation, DType number, int64_t rows, int64_t columns, float* gradient,
                        uint16_t* rounded, float* column_sum) {
  if (number == DType::fp32) {
    HWY_DYNAMIC_DISPATCH(mask_fp32)
    (static_cast<const float*>(activation), rows, columns, gradient, column_sum);
  } else {
    HWY_DYNAMIC_DISPATCH(mask_bf16)
    (static_cast<const int16_t*>(activation), rows, columns, gradient, rounded, column_sum);
  }
}

void add_slots(const float* from, int64_t slots, int64_t stride, int64_t count, float* to) {
  HWY_DYNAMIC_DISPATCH(sum_slots)(from, slots, stride, count, to);
}

}  // namespace traceflow::field
#endif

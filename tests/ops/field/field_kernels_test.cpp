#include "ops/field/field_kernels.h"

#include <gtest/gtest.h>

#include <bit>

#include "math/encoding.h"
#include "support/gradients.h"

namespace traceflow {
namespace {

using testing::random_tensor;

// Octaves of large coordinates are where a recurrence over octaves, or a reduction in single precision, loses
// everything.
TEST(FieldKernels, EncodingHoldsAgainstDoubleInEveryOctave) {
  constexpr int octaves = 10;
  constexpr int64_t columns = 64;
  for (const double extent : {1.0, 30.0, 1000.0}) {
    Random random(2);
    const Tensor<float> points = random_tensor<float>({500, 3}, random, -extent, extent);
    Tensor<float> encoding(Shape{512, columns});
    field::encode_points(points.data(), 500, 512, octaves, columns, encoding.data());
    for (int64_t i = 0; i < 512; ++i) {
      std::vector<double> expected(columns, 0.0);
      double point[3] = {};
      if (i < 500) std::copy_n(points.row(i), 3, point);
      positional_encoding(point, 3, octaves, expected.data());
      for (int64_t j = 0; j < columns; ++j) {
        ASSERT_NEAR(encoding(i, j), expected[static_cast<size_t>(j)], j < 3 ? 0 : 5e-7)
            << i << " column " << j;
      }
    }
  }
}

TEST(FieldKernels, RoundsToTheNearestBf16TiesToEven) {
  const std::pair<uint32_t, uint16_t> cases[] = {
      {0x3F800000, 0x3F80}, {0x3F807FFF, 0x3F80}, {0x3F808000, 0x3F80}, {0x3F808001, 0x3F81},
      {0x3F818000, 0x3F82}, {0xBF818000, 0xBF82}, {0x00000000, 0x0000}, {0x80000000, 0x8000},
      {0x7F800000, 0x7F80}, {0xFF800000, 0xFF80}, {0x7FC00000, 0x7FC0}, {0x7F7FFFFF, 0x7F80}};
  Tensor<float> from(Shape{16});
  Tensor<uint16_t> to(Shape{16});
  for (size_t i = 0; i < std::size(cases); ++i)
    from[static_cast<int64_t>(i)] = std::bit_cast<float>(cases[i].first);
  field::round_to_bf16(from.data(), 16, to.data());
  for (size_t i = 0; i < std::size(cases); ++i) EXPECT_EQ(to[static_cast<int64_t>(i)], cases[i].second) << i;
}

TEST(FieldKernels, MasksBySignOfTheActivationAndSumsColumns) {
  for (const int64_t columns : {16, 80, 256}) {
    constexpr int64_t rows = 9;
    Random random(4);
    Tensor<float> activation = random_tensor<float>({rows, columns}, random, -1, 1);
    for (float& a : activation.values()) a = std::max(a, 0.0F);
    activation(0, 0) = -0.0F;
    Tensor<uint16_t> activation_bf16(activation.shape());
    field::round_to_bf16(activation.data(), activation.size(), activation_bf16.data());
    const Tensor<float> gradient = random_tensor<float>({rows, columns}, random, -1, 1);

    for (const DType number : {DType::fp32, DType::bf16}) {
      const bool half = number == DType::bf16;
      Tensor<float> masked = gradient, sums(Shape{columns});
      Tensor<uint16_t> rounded(gradient.shape());
      sums.fill(5);
      const void* values = half ? static_cast<const void*>(activation_bf16.data()) : activation.data();
      field::mask_by_activation(values, number, rows, columns, masked.data(), half ? rounded.data() : nullptr,
                                sums.data());
      for (int64_t j = 0; j < columns; ++j) {
        float sum = 0;
        for (int64_t i = 0; i < rows; ++i) {
          const float expected = activation(i, j) > 0 ? gradient(i, j) : 0;
          ASSERT_EQ(masked(i, j), expected);
          sum += expected;
          const float sixteen[16] = {expected};
          uint16_t nearest[16];
          field::round_to_bf16(sixteen, 16, nearest);
          ASSERT_EQ(rounded(i, j), half ? nearest[0] : 0);
        }
        ASSERT_EQ(sums[j], 5 + sum);
      }
    }
  }
}

TEST(FieldKernels, AddsSlotsInOrder) {
  Tensor<float> slots(Shape{3, 40});
  for (int64_t i = 0; i < 40; ++i) {
    slots(0, i) = 1e8F;
    slots(1, i) = -1e8F;
    slots(2, i) = static_cast<float>(i);
  }
  Tensor<float> to(Shape{37});
  to.fill(0.5F);
  field::add_slots(slots.data(), 3, 40, 37, to.data());
  for (int64_t i = 0; i < 37; ++i) EXPECT_EQ(to[i], static_cast<float>(i) + 0.5F);
}

}  // namespace
}  // namespace traceflow

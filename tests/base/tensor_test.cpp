#include "base/tensor.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <vector>

namespace traceflow {
namespace {

TEST(Shape, ElementsAreTheProductOfTheDimensions) {
  EXPECT_EQ(Shape().elements(), 0);
  EXPECT_EQ(Shape({7}).elements(), 7);
  EXPECT_EQ(Shape({2, 3, 4, 5}).elements(), 120);
  EXPECT_EQ(Shape({2, 0, 4}).elements(), 0);
  EXPECT_EQ(Shape({2, 3}).to_string(), "2x3");
  EXPECT_EQ(Shape().to_string(), "()");
}

TEST(Shape, RefusesWhatNoTensorCanHave) {
  EXPECT_THROW(Shape({1, 2, 3, 4, 5}), InternalError);
  EXPECT_THROW(Tensor<float>({2, -1}), InternalError);
  EXPECT_THROW(Tensor<float>({int64_t{1} << 32, int64_t{1} << 32}), InternalError);
}

RC_GTEST_PROP(TensorProperty, IsRowMajorAndZeroAtFirst, ()) {
  const auto h = *rc::gen::inRange<int64_t>(1, 9), w = *rc::gen::inRange<int64_t>(1, 9);
  const auto c = *rc::gen::inRange<int64_t>(1, 5);
  Tensor<int32_t> t({h, w, c});
  for (const int32_t v : t.values()) RC_ASSERT(v == 0);
  for (int64_t i = 0; i < t.size(); ++i) t[i] = static_cast<int32_t>(i);
  int32_t expected = 0;
  for (int64_t i = 0; i < h; ++i) {
    RC_ASSERT(t.row(i) == t.data() + i * t.row_size());
    for (int64_t j = 0; j < w; ++j) {
      for (int64_t k = 0; k < c; ++k) RC_ASSERT(t(i, j, k) == expected++);
    }
  }
  RC_ASSERT(reinterpret_cast<uintptr_t>(t.data()) % 64 == 0);
}

TEST(Tensor, CopiesAreDeep) {
  Tensor<float> a({3});
  a.fill(1);
  Tensor<float> b = a;
  b[0] = 5;
  EXPECT_EQ(a[0], 1);
  a = b;
  EXPECT_EQ(a[0], 5);
  const Tensor<float>& same = a;
  a = same;
  EXPECT_EQ(a[0], 5);
}

TEST(Tensor, MovedFromIsEmptyAndCanBeUsedAgain) {
  Tensor<float> a({100});
  a.fill(2);
  const float* memory = a.data();
  Tensor<float> b = std::move(a);
  EXPECT_EQ(b.data(), memory);
  EXPECT_TRUE(a.empty());  // NOLINT(bugprone-use-after-move): what is left behind is what is tested
  EXPECT_EQ(a.shape(), Shape());
  a.reset({50});
  for (const float v : a.values()) EXPECT_EQ(v, 0);
  a = std::move(b);
  EXPECT_EQ(a.data(), memory);
  EXPECT_EQ(a[99], 2);
}

TEST(Tensor, ResizeKeepsTheAllocationWhereItIsLargeEnough) {
  Tensor<float> t({10, 10});
  const float* memory = t.data();
  t.resize({7, 3});
  t.resize({100});
  EXPECT_EQ(t.data(), memory);
  EXPECT_EQ(t.size(), 100);
  t.resize({101});
  EXPECT_EQ(t.size(), 101);
}

TEST(Tensor, EmptyTensorsHaveNoRows) {
  const Tensor<float> none, zero_rows({0, 3});
  EXPECT_TRUE(none.empty() && zero_rows.empty());
  EXPECT_EQ(none.row_size(), 0);
  EXPECT_EQ(zero_rows.row_size(), 0);
  EXPECT_EQ(zero_rows.dim(1), 3);
  EXPECT_TRUE(none.values().empty());
  Tensor<float> copy = none;
  EXPECT_TRUE(copy.empty());
  copy.reset({2, 3});
  EXPECT_TRUE(none.empty());
}

TEST(Tensor, ConvertKeepsShapeAndValues) {
  Tensor<double> t({2, 2});
  for (int64_t i = 0; i < 4; ++i) t[i] = 0.5 * static_cast<double>(i);
  const Tensor<float> f = convert<float>(t);
  EXPECT_EQ(f.shape(), t.shape());
  for (int64_t i = 0; i < 4; ++i) EXPECT_EQ(static_cast<double>(f[i]), t[i]);
}

}  // namespace
}  // namespace traceflow

#include "ops/optimize/adam.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "base/random.h"

namespace traceflow::optimize {
namespace {

AdamState zero_state(const Shape& shape) { return {Tensor<float>(shape), Tensor<float>(shape), 0}; }

Tensor<float> noise(const Shape& shape, uint64_t seed) {
  Random random(seed);
  Tensor<float> t(shape);
  for (float& v : t.values()) v = static_cast<float>(random.normal());
  return t;
}

template <size_t columns>
void expect_the_references_steps(int64_t rows, const std::array<float, columns>& rates) {
  const Shape shape{rows, static_cast<int64_t>(columns)};
  Tensor<float> parameter = noise(shape, 1);
  AdamState state = zero_state(shape);
  Tensor<double> expected = convert<double>(parameter);
  BasicAdamState<double> expected_state{Tensor<double>(shape), Tensor<double>(shape), 0};
  std::array<double, columns> rates_double{};
  std::copy(rates.begin(), rates.end(), rates_double.begin());
  for (uint64_t step = 0; step < 20; ++step) {
    const Tensor<float> gradient = noise(shape, 100 + step);
    EXPECT_EQ(adam_step(parameter, gradient, state, rates, {}), 0);
    adam_step_reference(expected, convert<double>(gradient), expected_state, rates_double, {});
  }
  for (int64_t i = 0; i < parameter.size(); ++i) {
    ASSERT_NEAR(static_cast<double>(parameter[i]), expected[i], 2e-5 * (1 + std::abs(expected[i]))) << i;
  }
  EXPECT_EQ(state.step, 20);
}

TEST(Adam, AgreesWithTheReferenceOverManySteps) {
  expect_the_references_steps<7>(331, {0.1F, 0.01F, 0.02F, 0.3F, 0.05F, 0, 0.07F});
}

// Blocks of whole rows of three begin at addresses that no vector is aligned to.
TEST(Adam, BlocksMayBeginAnywhere) { expect_the_references_steps<3>(12001, {0.1F, 0.01F, 0.02F}); }

TEST(Adam, FirstStepMovesEveryParameterByTheRateAgainstItsGradient) {
  // m̂/√v̂ = ±1 on the first step whatever the gradient's size.
  Tensor<float> parameter(Shape{3});
  AdamState state = zero_state(parameter.shape());
  Tensor<float> gradient(Shape{3});
  gradient[0] = 1e-6F;
  gradient[1] = -2;
  gradient[2] = 500;
  adam_step(parameter, gradient, state, 0.25F, {});
  EXPECT_NEAR(parameter[0], -0.25F, 1e-5F);
  EXPECT_NEAR(parameter[1], 0.25F, 1e-5F);
  EXPECT_NEAR(parameter[2], -0.25F, 1e-5F);
}

TEST(Adam, ZeroGradientWithZeroMomentsChangesNothing) {
  Tensor<float> parameter = noise({40}, 3);
  const Tensor<float> before = parameter;
  AdamState state = zero_state(parameter.shape());
  adam_step(parameter, Tensor<float>(Shape{40}), state, 1.0F, {});
  for (int64_t i = 0; i < 40; ++i) EXPECT_EQ(parameter[i], before[i]);
}

TEST(Adam, LeavesEntriesWithoutAFiniteGradientAloneAndCountsThem) {
  const Shape shape{67};
  Tensor<float> parameter = noise(shape, 4);
  const Tensor<float> before = parameter;
  AdamState state = zero_state(shape);
  Tensor<float> gradient = noise(shape, 5);
  gradient[3] = std::numeric_limits<float>::quiet_NaN();
  gradient[66] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(adam_step(parameter, gradient, state, 0.1F, {}), 2);
  for (const int64_t i : {3, 66}) {
    EXPECT_EQ(parameter[i], before[i]);
    EXPECT_EQ(state.first[i], 0);
    EXPECT_EQ(state.second[i], 0);
  }
  EXPECT_NE(parameter[0], before[0]);
}

// An infinite second moment would hold its parameter still for ever.
TEST(Adam, AGradientWhoseSquareOverflowsIsLeftOut) {
  Tensor<float> parameter(Shape{2}), gradient(Shape{2});
  AdamState state = zero_state(parameter.shape());
  gradient[0] = 1e30F;
  gradient[1] = 1e18F;
  EXPECT_EQ(adam_step(parameter, gradient, state, 0.1F, {}), 1);
  EXPECT_EQ(state.second[0], 0);
  EXPECT_NEAR(parameter[1], -0.1F, 1e-6F);
}

// Oracle: with a constant gradient m̂ = g and v̂ = g² at every step, so that every step is the learning rate.
TEST(Adam, AConstantGradientWalksAtTheLearningRate) {
  Tensor<double> parameter(Shape{1}), gradient(Shape{1});
  BasicAdamState<double> state{Tensor<double>(Shape{1}), Tensor<double>(Shape{1}), 0};
  gradient[0] = -0.3;
  const double rate = 0.01;
  for (int i = 0; i < 1000; ++i) adam_step_reference(parameter, gradient, state, std::span(&rate, 1), {});
  EXPECT_NEAR(parameter[0], 10, 1e-7);
}

TEST(Adam, RefusesShapesThatDoNotFit) {
  Tensor<float> parameter(Shape{4});
  AdamState state = zero_state(parameter.shape());
  EXPECT_THROW(adam_step(parameter, Tensor<float>(Shape{3}), state, 0.1F, {}), InternalError);
  EXPECT_THROW(adam_step(parameter, Tensor<float>(Shape{4}), state, std::span<const float>(), {}),
               InternalError);
  state.second.resize({3});
  EXPECT_THROW(adam_step(parameter, Tensor<float>(Shape{4}), state, 0.1F, {}), InternalError);
}

TEST(Adam, EmptyTensorIsFine) {
  Tensor<float> parameter(Shape{0, 3});
  AdamState state = zero_state(parameter.shape());
  EXPECT_EQ(adam_step(parameter, Tensor<float>(Shape{0, 3}), state, 0.1F, {}), 0);
}

TEST(Adam, SameBytesAtAnyThreadCount) {
  const Shape shape{50000, 3};
  Tensor<float> results[3];
  for (int threads = 1; threads <= 3; ++threads) {
    set_threads(threads);
    Tensor<float>& parameter = results[threads - 1];
    parameter = noise(shape, 6);
    AdamState state = zero_state(shape);
    for (uint64_t step = 0; step < 3; ++step) adam_step(parameter, noise(shape, 7 + step), state, 0.1F, {});
  }
  set_threads(0);
  for (int64_t i = 0; i < results[0].size(); ++i) {
    ASSERT_EQ(results[0][i], results[1][i]);
    ASSERT_EQ(results[0][i], results[2][i]);
  }
}

TEST(LogLinear, RunsFromStartToEndWithAConstantRatio) {
  EXPECT_DOUBLE_EQ(log_linear(1e-2, 1e-4, 0, 100), 1e-2);
  EXPECT_NEAR(log_linear(1e-2, 1e-4, 50, 100), 1e-3, 1e-12);
  EXPECT_NEAR(log_linear(1e-2, 1e-4, 100, 100), 1e-4, 1e-12);
  EXPECT_NEAR(log_linear(1e-2, 1e-4, 1000, 100), 1e-4, 1e-12);
}

}  // namespace
}  // namespace traceflow::optimize

#include "math/activation.h"

#include <gtest/gtest.h>

#include <limits>

namespace traceflow {
namespace {

TEST(Activation, SigmoidIsStableForAnyNumber) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(sigmoid(0.0), 0.5);
  EXPECT_EQ(sigmoid(infinity), 1);
  EXPECT_EQ(sigmoid(-infinity), 0);
  EXPECT_NEAR(sigmoid(-700.0) / std::exp(-700.0), 1, 1e-12);
  EXPECT_TRUE(std::isnan(sigmoid(std::numeric_limits<double>::quiet_NaN())));
  for (double x = -30; x <= 30; x += 0.25) EXPECT_NEAR(sigmoid(x) + sigmoid(-x), 1, 1e-15) << x;
}

TEST(Activation, LogitInvertsSigmoid) {
  for (double x = -15; x <= 15; x += 0.5) EXPECT_NEAR(logit(sigmoid(x)), x, 1e-8) << x;
  EXPECT_NEAR(logit(0.1), std::log(0.1 / 0.9), 1e-15);
}

TEST(Activation, DerivativeMatchesCentralDifferences) {
  for (double x = -6; x <= 6; x += 0.5) {
    const double difference = (sigmoid(x + 1e-6) - sigmoid(x - 1e-6)) / 2e-6;
    EXPECT_NEAR(sigmoid_derivative(sigmoid(x)), difference, 1e-9) << x;
  }
}

}  // namespace
}  // namespace traceflow

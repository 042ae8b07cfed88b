#include "math/blend.h"

#include <gtest/gtest.h>

#include <array>

#include "base/random.h"
#include "math/finite_differences.h"

namespace traceflow {
namespace {

constexpr BlendRules<double> rules{1.0 / 255, 0.99, 1e-4};

TEST(Blend, alpha_is_skipped_kept_or_clamped) {
  EXPECT_EQ(blend_alpha(rules, 0.5, 0.001).value, 0);
  EXPECT_EQ(blend_alpha(rules, 0.5, 0.001).slope, 0);
  EXPECT_EQ(blend_alpha(rules, 0.5, 0.5).value, 0.25);
  EXPECT_EQ(blend_alpha(rules, 0.5, 0.5).slope, 1);
  EXPECT_EQ(blend_alpha(rules, 1.0, 0.999).value, 0.99);
  EXPECT_EQ(blend_alpha(rules, 1.0, 0.999).slope, 0);
  EXPECT_EQ(blend_alpha(rules, std::nan(""), 0.5).value, 0);
}

TEST(Blend, ends_before_the_transmittance_falls_under_the_limit) {
  EXPECT_FALSE(blend_ends(rules, 0.011, 0.99));
  EXPECT_TRUE(blend_ends(rules, 0.009, 0.99));
}

TEST(Blend, cutoff_radius_is_where_alpha_reaches_its_minimum) {
  const double radius2 = cutoff_radius2(rules, 0.7);
  EXPECT_NEAR(0.7 * std::exp(-radius2 / 2), rules.alpha_min, 1e-15);
  EXPECT_LT(cutoff_radius2(rules, 0.001), 0);
  EXPECT_LT(cutoff_radius2(rules, 0.0), 0);
}

TEST(Blend, alpha_gradient_matches_central_differences) {
  Random random(3);
  std::array<double, 5> alpha{};
  std::array<double, 5> value{};
  for (double& a : alpha) a = random.uniform(0.1, 0.9);
  for (double& v : value) v = random.normal();
  const auto blend = [&] {
    double sum = 0;
    double transmittance = 1;
    for (size_t i = 0; i < alpha.size(); ++i) {
      sum += transmittance * alpha[i] * value[i];
      transmittance *= 1 - alpha[i];
    }
    return sum;
  };
  for (size_t i = 0; i < alpha.size(); ++i) {
    double before = 1;
    for (size_t j = 0; j < i; ++j) before *= 1 - alpha[j];
    double behind = 0;
    double transmittance = before * (1 - alpha[i]);
    for (size_t j = i + 1; j < alpha.size(); ++j) {
      behind += transmittance * alpha[j] * value[j];
      transmittance *= 1 - alpha[j];
    }
    expect_derivative(blend_alpha_gradient(before, alpha[i], value[i], behind), alpha[i], blend, "alpha");
  }
}

TEST(DistortionDepth, runs_from_zero_to_one_and_matches_central_differences) {
  EXPECT_EQ(distortion_depth(0.2, 100.0, 0.2), 0);
  EXPECT_NEAR(distortion_depth(0.2, 100.0, 100.0), 1, 1e-15);
  double z = 1.7;
  expect_derivative(
      distortion_depth_slope(0.2, 100.0, z), z, [&] { return distortion_depth(0.2, 100.0, z); }, "z");
}

}  // namespace
}  // namespace traceflow

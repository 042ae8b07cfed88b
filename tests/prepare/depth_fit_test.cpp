#include "prepare/depth_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace traceflow::prepare {
namespace {

// Values of an estimator with this scale and shift at depths from 1 to 5. A share of the points is hidden
// behind what the estimator sees.
std::vector<DepthSample> samples_of(DepthKind kind, double scale, double shift, double noise, double hidden,
                                    uint64_t seed) {
  Random random(seed);
  std::vector<DepthSample> samples;
  for (int i = 0; i < 300; ++i) {
    const double depth = random.uniform(1, 5);
    const double seen = depth * (1 + noise * random.normal());
    const double target = kind == DepthKind::inverse ? 1 / seen : seen;
    const bool is_hidden = random.uniform() < hidden;
    samples.push_back({(target - shift) / scale, is_hidden ? depth * random.uniform(1.3, 3) : depth});
  }
  return samples;
}

class FitOf : public testing::TestWithParam<DepthKind> {};

TEST_P(FitOf, ExactValuesGiveTheScaleAndTheShiftThoughMostPointsAreHidden) {
  const auto fit = fit_depths(samples_of(GetParam(), 0.02, -0.3, 0, 0.55, 1), GetParam());
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->scale, 0.02, 1e-9);
  EXPECT_NEAR(fit->shift, -0.3, 1e-8);
  EXPECT_NEAR(fit->inliers, 0.45, 0.06);
  EXPECT_NEAR(fit->error, 0, 1e-9);
  EXPECT_NEAR(fit->depth_of(200), GetParam() == DepthKind::inverse ? 1 / 3.7 : 3.7, 1e-6);
}

TEST_P(FitOf, NoisyValuesGiveDepthsWithinTheNoise) {
  const auto fit = fit_depths(samples_of(GetParam(), 0.5, 0.1, 0.03, 0.3, 2), GetParam());
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->error, 0.67 * 0.03, 0.006) << "the median of a normal deviate is 0.67 of its deviation";
  for (const double depth : {1.0, 2.0, 5.0}) {
    const double target = GetParam() == DepthKind::inverse ? 1 / depth : depth;
    EXPECT_NEAR(fit->depth_of((target - 0.1) / 0.5), depth, 0.01 * depth);
  }
}

TEST_P(FitOf, TheKindThatFitsIsFound) {
  std::map<std::string, std::vector<DepthSample>> views;
  for (uint64_t v = 0; v < 4; ++v)
    views.emplace(std::to_string(v),
                  samples_of(GetParam(), 1 + 0.2 * static_cast<double>(v), 0.4, 0.03, 0.3, v));
  const DepthFits fits = fit_views(views, DepthKind::automatic);
  EXPECT_EQ(fits.kind, GetParam());
  EXPECT_EQ(fits.of_view.size(), 4U);
  EXPECT_NEAR(fits.error(), 0.02, 0.006);
  EXPECT_NEAR(fits.of_view.at("3").scale, 1.6, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Both, FitOf, testing::Values(DepthKind::depth, DepthKind::inverse));

TEST(FitDepths, ValuesThatSayNothingAboutDepthAreNotFitted) {
  Random random(3);
  std::vector<DepthSample> samples;
  for (int i = 0; i < 300; ++i) samples.push_back({random.uniform(), std::exp(random.uniform(-3, 3))});
  EXPECT_FALSE(fit_depths(samples, DepthKind::depth));
  EXPECT_FALSE(fit_depths(samples, DepthKind::inverse));
  std::vector<DepthSample> few = samples_of(DepthKind::depth, 1, 0, 0, 0, 4);
  few.resize(15);
  EXPECT_FALSE(fit_depths(few, DepthKind::depth));
  few.push_back(few.front());
  EXPECT_TRUE(fit_depths(few, DepthKind::depth));
  // Far is near: an estimator's depths that are attached as inverse depths.
  EXPECT_FALSE(fit_depths(samples_of(DepthKind::depth, -1, 6, 0, 0, 5), DepthKind::depth));
}

TEST(DepthFit, GivesNoDepthBehindTheCamera) {
  const DepthFit depth{DepthKind::depth, 2, -1}, inverse{DepthKind::inverse, 2, -1};
  EXPECT_EQ(depth.depth_of(0.5), 0);
  EXPECT_EQ(inverse.depth_of(0.25), 0);
  EXPECT_EQ(inverse.depth_of(NAN), 0);
  EXPECT_EQ(inverse.depth_of(1), 1);
}

}  // namespace
}  // namespace traceflow::prepare

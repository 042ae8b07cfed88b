#include "eval/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "support/narrow_lpips.h"

namespace traceflow::eval {
namespace {

Tensor<float> constant(int64_t h, int64_t w, float value) {
  Tensor<float> image(Shape{h, w, 3});
  image.fill(value);
  return image;
}

const Tensor<float> nothing;
Rendered only(const Tensor<float>& colour) { return {colour, nothing, nothing, nothing}; }

Tensor<float> random_image(int64_t h, int64_t w, uint64_t seed) {
  Random random(seed);
  Tensor<float> image(Shape{h, w, 3});
  for (float& v : image.values()) v = static_cast<float>(random.uniform());
  return image;
}

TEST(Psnr, OfAConstantErrorIsItsDefinition) {
  EXPECT_NEAR(*psnr(constant(4, 5, 0.5F), constant(4, 5, 0.25F), {}), 20 * std::log10(4.0), 1e-6);
}

TEST(Psnr, CountsOnlyTheMask) {
  Tensor<float> image = constant(2, 2, 0.5F);
  image(0, 0, 0) = image(0, 0, 1) = image(0, 0, 2) = 0.6F;
  Tensor<uint8_t> mask(Shape{2, 2});
  EXPECT_FALSE(psnr(image, constant(2, 2, 0.5F), mask).has_value());
  mask(0, 0) = 255;
  EXPECT_NEAR(*psnr(image, constant(2, 2, 0.5F), mask), 20, 1e-4);
  mask(0, 0) = 0;
  mask(1, 1) = 1;
  EXPECT_FALSE(psnr(image, constant(2, 2, 0.5F), mask).has_value()) << "equal inside the mask";
}

TEST(NormalError, IsTheMeanAngleWhereTruthIs) {
  Tensor<float> truth(Shape{1, 4, 3}), normal(Shape{1, 4, 3});
  truth(0, 0, 2) = truth(0, 1, 2) = truth(0, 2, 2) = 1;
  normal(0, 0, 2) = 0.2F;                    // 0°, not of unit length
  normal(0, 1, 0) = normal(0, 1, 2) = 0.5F;  // 45°
  normal(0, 3, 1) = 1;                       // no truth: does not count
  EXPECT_NEAR(*normal_mae_deg(normal, truth, {}), (0 + 45 + 90) / 3.0, 1e-5) << "nothing rendered counts 90";
  Tensor<uint8_t> mask(Shape{1, 4});
  mask(0, 1) = mask(0, 3) = 1;
  EXPECT_NEAR(*normal_mae_deg(normal, truth, mask), 45, 1e-5);
  EXPECT_FALSE(normal_mae_deg(normal, {}, mask).has_value());
  EXPECT_FALSE(normal_mae_deg(normal, Tensor<float>(Shape{1, 4, 3}), {}).has_value());
}

TEST(NormalError, KeepsSmallAngles) {
  Tensor<float> truth(Shape{1, 1, 3}), normal(Shape{1, 1, 3});
  truth(0, 0, 2) = 1;
  normal(0, 0, 0) = 1e-5F;
  normal(0, 0, 2) = 1;
  EXPECT_NEAR(*normal_mae_deg(normal, truth, {}), 1e-5 * 180 / std::numbers::pi, 1e-9);
}

TEST(NormalError, TakesANormalThatIsNotFiniteAsNone) {
  Tensor<float> truth(Shape{1, 1, 3}), normal(Shape{1, 1, 3});
  truth(0, 0, 2) = 1;
  normal(0, 0, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(*normal_mae_deg(normal, truth, {}), 90);
}

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

Tensor<float> row_of(const std::vector<float>& values) {
  Tensor<float> row({1, static_cast<int64_t>(values.size())});
  std::copy(values.begin(), values.end(), row.data());
  return row;
}

TEST(DepthErrors, AreRelativeToTheTruth) {
  // 1.25 rendered units are one of the truth.
  const Tensor<float> errors = depth_errors(row_of({2.5F, 5, 1.25F, 7.5F}), {}, row_of({2, 2, 2, 2}), 1.25);
  EXPECT_FLOAT_EQ(errors[0], 0);
  EXPECT_FLOAT_EQ(errors[1], 1);
  EXPECT_FLOAT_EQ(errors[2], 0.5F);
  EXPECT_FLOAT_EQ(errors[3], 2);
}

TEST(DepthErrors, AHoleCountsOneAndNoTruthNothing) {
  const Tensor<float> depth = row_of({0, -1, nan, infinity, 2, 2, 2, 2}),
                      alpha = row_of({1, 1, 1, 1, 0.49F, 0.5F, nan, 1}),
                      truth = row_of({2, 2, 2, 2, 2, 2, 2, 0});
  const std::vector<float> expected = {1, 1, 1, 1, 1, 0, 1, -1};
  const Tensor<float> errors = depth_errors(depth, alpha, truth, 1);
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(errors[static_cast<int64_t>(i)], expected[i]) << i;
}

TEST(Measure, DepthErrorsAreOfTheMaskItsCoreAndTheRest) {
  // One row of 120: its rim is 2 wide, so the mask of 7 has a core of 3.
  Tensor<float> colour(Shape{1, 120, 3}), target(Shape{1, 120, 3}), depth(Shape{1, 120}),
      truth(Shape{1, 120});
  Tensor<uint8_t> mask(Shape{1, 120});
  depth.fill(2);
  truth.fill(2);
  for (int64_t x = 50; x < 57; ++x) {
    mask[x] = 1;
    const bool is_core = x >= 52 && x < 55;
    depth[x] = is_core ? 2.2F : 3;
    for (int64_t c = 0; c < 3; ++c) target(0, x, c) = is_core ? 51.0F / 255 : 1;
  }
  depth[54] = 2;
  truth[51] = 0;  // no truth: its error of a half does not count
  depth[0] = 2.5F;
  const Metrics m =
      measure({colour, nothing, depth, nothing}, {target, mask, nothing, nullptr, &truth}, nullptr);
  EXPECT_NEAR(*m.core_psnr, 20 * std::log10(5.0), 1e-5);
  EXPECT_LT(*m.masked_psnr, *m.core_psnr);
  EXPECT_NEAR(*m.core_depth_error_median, 0.1, 1e-6);
  EXPECT_NEAR(*m.core_depth_error_mean, (0.1 + 0.1 + 0) / 3, 1e-6);
  EXPECT_NEAR(*m.masked_depth_error_median, (0.1 + 0.5) / 2, 1e-6);
  EXPECT_NEAR(*m.masked_depth_error_mean, (0.2 + 3 * 0.5) / 6, 1e-6);
  EXPECT_NEAR(*m.outside_depth_error_median, 0, 1e-9);
  EXPECT_NEAR(*m.outside_depth_error_mean, 0.25 / 113, 1e-7);
}

TEST(Measure, DepthErrorsNeedAMaskAndATruth) {
  const Tensor<float> colour = constant(8, 9, 0.5F), depth(Shape{8, 9});
  Tensor<float> truth(Shape{8, 9});
  const Tensor<uint8_t> mask(Shape{8, 9});
  EXPECT_FALSE(measure({colour, nothing, depth, nothing}, {colour, mask, nothing, nullptr, &truth}, nullptr)
                   .outside_depth_error_median);
  truth.fill(1);
  const Metrics m =
      measure({colour, nothing, depth, nothing}, {colour, mask, nothing, nullptr, &truth}, nullptr);
  EXPECT_EQ(m.outside_depth_error_median, 1)
      << "a mask without a pixel: all is outside, and nothing rendered";
  EXPECT_FALSE(m.masked_depth_error_mean || m.core_depth_error_mean || m.core_psnr);
  EXPECT_FALSE(measure({colour, nothing, depth, nothing}, {colour, {}, nothing, nullptr, &truth}, nullptr)
                   .outside_depth_error_mean);
}

TEST(Measure, RoundsTo8BitFirst) {
  // Both round to 128/255: nothing is left to measure.
  const Tensor<float> target = constant(20, 20, 128.0F / 255);
  const Tensor<float> image = constant(20, 20, 128.4F / 255);
  const Metrics m = measure(only(image), {target, {}, {}}, nullptr);
  EXPECT_FALSE(m.psnr.has_value());
  EXPECT_NEAR(*m.ssim, 1, 1e-6);
}

TEST(Measure, LeavesOutWhatCannotBeHad) {
  const Tensor<float> target = random_image(20, 20, 1), image = random_image(20, 20, 2);
  const Metrics m = measure(only(image), {target, Tensor<uint8_t>(Shape{20, 20}), {}}, nullptr);
  EXPECT_TRUE(m.psnr && m.ssim);
  EXPECT_FALSE(m.lpips || m.lpips_published || m.masked_psnr || m.masked_ssim || m.normal_mae_deg ||
               m.masked_normal_mae_deg);
}

TEST(Measure, AFullMaskChangesNothing) {
  const Tensor<float> target = random_image(30, 24, 1), image = random_image(30, 24, 2);
  Tensor<uint8_t> mask(Shape{30, 24});
  mask.fill(1);
  const Metrics m = measure(only(image), {target, mask, {}}, nullptr);
  EXPECT_NEAR(*m.masked_psnr, *m.psnr, 1e-9);
  EXPECT_NEAR(*m.masked_ssim, *m.ssim, 1e-6);
}

// Ten by ten pixels, of which a column is unknown and wrong: it counts in no mean.
TEST(Measure, CountsColoursThatAreKnown) {
  Tensor<float> image = constant(10, 10, 102.0F / 255), target = constant(10, 10, 51.0F / 255);
  Tensor<uint8_t> known(Shape{10, 10}), mask(Shape{10, 10});
  known.fill(1);
  for (int64_t y = 0; y < 10; ++y) {
    known(y, 3) = 0;
    mask(y, 3) = mask(y, 4) = 1;
    for (int64_t c = 0; c < 3; ++c) target(y, 3, c) = image(y, 3, c);
  }
  const Metrics m = measure(only(image), {target, mask, {}, &known}, nullptr);
  EXPECT_NEAR(*m.psnr, 20 * std::log10(5.0), 1e-5);
  EXPECT_NEAR(*m.masked_psnr, 20 * std::log10(5.0), 1e-5);
  const Metrics unknown_counts = measure(only(image), {target, mask, {}}, nullptr);
  EXPECT_GT(*unknown_counts.psnr, *m.psnr + 0.4);
  EXPECT_GT(*unknown_counts.masked_ssim, *m.masked_ssim);
}

TEST(Measure, APictureOfWhichNothingIsKnownHasNoFigures) {
  const Tensor<float> image = constant(40, 40, 0.4F);
  const Tensor<uint8_t> known(Shape{40, 40});
  const lpips::Network network = lpips::network_of(traceflow::testing::narrow_lpips_weights(1));
  EXPECT_TRUE(measure(only(image), {image, {}, {}}, &network).lpips);
  const Metrics m = measure(only(image), {image, {}, {}, &known}, &network);
  EXPECT_FALSE(m.psnr || m.ssim || m.lpips || m.lpips_published);
}

TEST(Mean, IsOverTheViewsThatHaveTheFigure) {
  Metrics a, b;
  a.psnr = 20;
  b.psnr = 30;
  b.lpips = 0.5;
  const Metrics m = mean({a, b, Metrics{}});
  EXPECT_EQ(*m.psnr, 25);
  EXPECT_EQ(*m.lpips, 0.5);
  EXPECT_FALSE(m.ssim.has_value());
  EXPECT_FALSE(mean({}).psnr.has_value());
}

}  // namespace
}  // namespace traceflow::eval

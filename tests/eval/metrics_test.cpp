#include "eval/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/random.h"
#include "support/narrow_lpips.h"

namespace traceflow::eval {
namespace {

Tensor<float> constant(int64_t h, int64_t w, float value) {
  Tensor<float> image(Shape{h, w, 3});
  image.fill(value);
  return image;
}

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

TEST(Measure, RoundsTo8BitFirst) {
  // Both round to 128/255: nothing is left to measure.
  const Tensor<float> target = constant(20, 20, 128.0F / 255);
  const Tensor<float> image = constant(20, 20, 128.4F / 255);
  const Metrics m = measure(image, {}, {target, {}, {}}, nullptr);
  EXPECT_FALSE(m.psnr.has_value());
  EXPECT_NEAR(*m.ssim, 1, 1e-6);
}

TEST(Measure, LeavesOutWhatCannotBeHad) {
  const Tensor<float> target = random_image(20, 20, 1), image = random_image(20, 20, 2);
  const Metrics m = measure(image, {}, {target, Tensor<uint8_t>(Shape{20, 20}), {}}, nullptr);
  EXPECT_TRUE(m.psnr && m.ssim);
  EXPECT_FALSE(m.lpips || m.lpips_published || m.masked_psnr || m.masked_ssim || m.normal_mae_deg ||
               m.masked_normal_mae_deg);
}

TEST(Measure, AFullMaskChangesNothing) {
  const Tensor<float> target = random_image(30, 24, 1), image = random_image(30, 24, 2);
  Tensor<uint8_t> mask(Shape{30, 24});
  mask.fill(1);
  const Metrics m = measure(image, {}, {target, mask, {}}, nullptr);
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
  const Metrics m = measure(image, {}, {target, mask, {}, &known}, nullptr);
  EXPECT_NEAR(*m.psnr, 20 * std::log10(5.0), 1e-5);
  EXPECT_NEAR(*m.masked_psnr, 20 * std::log10(5.0), 1e-5);
  const Metrics unknown_counts = measure(image, {}, {target, mask, {}}, nullptr);
  EXPECT_GT(*unknown_counts.psnr, *m.psnr + 0.4);
  EXPECT_GT(*unknown_counts.masked_ssim, *m.masked_ssim);
}

TEST(Measure, APictureOfWhichNothingIsKnownHasNoFigures) {
  const Tensor<float> image = constant(40, 40, 0.4F);
  const Tensor<uint8_t> known(Shape{40, 40});
  const lpips::Network network = lpips::network_of(traceflow::testing::narrow_lpips_weights(1));
  EXPECT_TRUE(measure(image, {}, {image, {}, {}}, &network).lpips);
  const Metrics m = measure(image, {}, {image, {}, {}, &known}, &network);
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

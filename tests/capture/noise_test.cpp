#include "capture/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace traceflow {
namespace {

// A slow gradient with normal noise, rounded and cut off as a camera does; one edge of 80 levels.
Tensor<uint8_t> noisy_picture(int64_t size, double middle, double deviation, uint64_t seed) {
  Random random(seed);
  Tensor<uint8_t> picture({size, size, 3});
  for (int64_t y = 0; y < size; ++y) {
    for (int64_t x = 0; x < size; ++x) {
      for (int64_t c = 0; c < 3; ++c) {
        const double value = middle + 0.1 * static_cast<double>(x + y) + (x > size / 3 ? 80 : 0) +
                             deviation * static_cast<double>(random.normal());
        picture(y, x, c) = static_cast<uint8_t>(std::clamp(std::round(value), 0.0, 255.0));
      }
    }
  }
  return picture;
}

TEST(Noise, is_the_deviation_that_was_added) {
  const Tensor<uint8_t> everywhere;
  for (const double deviation : {1.0, 2.0, 4.0, 8.0, 16.0}) {
    // Rounding adds a variance of 1/12.
    const double expected = std::sqrt(deviation * deviation + 1.0 / 12);
    EXPECT_NEAR(noise_deviation(noisy_picture(128, 60, deviation, 3), everywhere).value(), expected,
                0.05 * expected)
        << deviation;
  }
}

TEST(Noise, leaves_out_what_is_cut_off) {
  // Half of all values are cut off at 255.
  const Tensor<uint8_t> bright = noisy_picture(128, 255 - 80 - 13, 8, 5), everywhere;
  EXPECT_NEAR(noise_deviation(bright, everywhere).value(), 8, 1.2);
}

TEST(Noise, is_told_of_the_mask_alone) {
  Tensor<uint8_t> picture = noisy_picture(64, 60, 1, 7);
  const Tensor<uint8_t> noisier = noisy_picture(64, 60, 6, 8);
  Tensor<uint8_t> mask({64, 64});
  for (int64_t y = 20; y < 50; ++y) {
    for (int64_t x = 11; x < 45; ++x) {
      mask(y, x) = 1;
      for (int64_t c = 0; c < 3; ++c) picture(y, x, c) = noisier(y, x, c);
    }
  }
  EXPECT_NEAR(noise_deviation(picture, mask).value(), 6, 0.6);
}

TEST(Noise, is_not_told_of_few_pixels) {
  EXPECT_FALSE(noise_deviation(Tensor<uint8_t>({10, 10, 3}), Tensor<uint8_t>()).has_value());
  EXPECT_FALSE(noise_deviation(noisy_picture(64, 60, 2, 1), Tensor<uint8_t>({64, 64})).has_value());
  EXPECT_FALSE(noise_deviation(Tensor<uint8_t>({1, 500, 3}), Tensor<uint8_t>()).has_value());
}

}  // namespace
}  // namespace traceflow

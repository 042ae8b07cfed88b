#include "capture/sharpness.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/random.h"

namespace traceflow {
namespace {

TEST(Grey, weighs_red_green_and_blue_and_keeps_greys) {
  Tensor<uint8_t> colours({2, 2, 4});
  const uint8_t values[] = {255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 255, 9, 255, 255, 255, 0};
  std::copy(std::begin(values), std::end(values), colours.data());
  const Tensor<uint8_t> grey = grey_of(colours);
  ASSERT_EQ(grey.shape(), (Shape{2, 2, 1}));
  // The weights in parts of 256.
  EXPECT_NEAR(grey[0], 0.299 * 255, 1);
  EXPECT_NEAR(grey[1], 0.587 * 255, 1);
  EXPECT_NEAR(grey[2], 0.114 * 255, 1);
  EXPECT_EQ(grey[3], 255);
  Tensor<uint8_t> even({1, 256, 3});
  for (int64_t i = 0; i < even.size(); ++i) even[i] = static_cast<uint8_t>(i / 3);
  for (int level = 0; level < 256; ++level) EXPECT_EQ(grey_of(even)[level], level);
  EXPECT_EQ(grey_of(grey).data()[1], grey[1]);
}

TEST(Sharpness, is_the_variance_of_the_laplacian) {
  // One bright pixel: over the 3×3 inner pixels the Laplacian is -4·9 once, 9 four times and 0 four times.
  Tensor<uint8_t> grey({5, 5});
  grey(2, 2) = 9;
  EXPECT_NEAR(sharpness(grey), (16 * 81 + 4 * 81) / 9.0, 1e-9);
}

TEST(Sharpness, falls_when_a_picture_is_blurred) {
  Random random(7);
  Tensor<uint8_t> picture({24, 32, 1});
  for (uint8_t& value : picture.values()) value = static_cast<uint8_t>(random.below(256));
  Tensor<uint8_t> blurred = picture;
  for (int64_t y = 1; y < 23; ++y) {
    for (int64_t x = 1; x < 31; ++x) {
      int sum = 0;
      for (int64_t j = -1; j <= 1; ++j) {
        for (int64_t i = -1; i <= 1; ++i) sum += picture(y + j, x + i, 0);
      }
      blurred(y, x, 0) = static_cast<uint8_t>(sum / 9);
    }
  }
  EXPECT_GT(sharpness(picture), 5 * sharpness(blurred));
}

TEST(Sharpness, of_what_has_no_edges_is_zero) {
  Tensor<uint8_t> ramp({4, 6});
  for (int64_t i = 0; i < 24; ++i) ramp[i] = static_cast<uint8_t>(3 * (i % 6) + 7 * (i / 6));
  EXPECT_EQ(sharpness(ramp), 0);
  EXPECT_EQ(sharpness(Tensor<uint8_t>({2, 9})), 0);
}

}  // namespace
}  // namespace traceflow

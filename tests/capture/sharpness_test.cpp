#include "capture/sharpness.h"

#include <gtest/gtest.h>

namespace traceflow {
namespace {

TEST(Sharpness, is_the_variance_of_the_laplacian) {
  // One bright pixel: over the 3×3 inner pixels the Laplacian is -4·9 once, 9 four times and 0 four times.
  Tensor<uint8_t> grey({5, 5});
  grey(2, 2) = 9;
  EXPECT_NEAR(sharpness(grey), (16 * 81 + 4 * 81) / 9.0, 1e-9);
}

TEST(Sharpness, of_what_has_no_edges_is_zero) {
  Tensor<uint8_t> ramp({4, 6});
  for (int64_t i = 0; i < 24; ++i) ramp[i] = static_cast<uint8_t>(3 * (i % 6) + 7 * (i / 6));
  EXPECT_EQ(sharpness(ramp), 0);
  EXPECT_EQ(sharpness(Tensor<uint8_t>({2, 9})), 0);
}

}  // namespace
}  // namespace traceflow

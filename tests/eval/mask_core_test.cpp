#include "eval/mask_core.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/random.h"

namespace traceflow::eval {
namespace {

// By its definition, pixel against pixel.
Tensor<uint8_t> eroded_plainly(const Tensor<uint8_t>& mask, int64_t radius) {
  Tensor<uint8_t> core(mask.shape());
  for (int64_t y = 0; y < mask.dim(0); ++y) {
    for (int64_t x = 0; x < mask.dim(1); ++x) {
      bool inside = true;
      for (int64_t v = 0; v < mask.dim(0); ++v) {
        for (int64_t u = 0; u < mask.dim(1); ++u) {
          const int64_t distance2 = (u - x) * (u - x) + (v - y) * (v - y);
          inside = inside && (mask(v, u) != 0 || distance2 > radius * radius);
        }
      }
      core(y, x) = inside ? 1 : 0;
    }
  }
  return core;
}

RC_GTEST_PROP(MaskCore, is_as_far_from_the_outside_as_its_radius_says, ()) {
  const auto height = *rc::gen::inRange<int64_t>(1, 16), width = *rc::gen::inRange<int64_t>(1, 16);
  const auto radius = *rc::gen::inRange<int64_t>(1, 6), holes = *rc::gen::inRange<int64_t>(0, 6);
  Random random(*rc::gen::arbitrary<uint64_t>());
  Tensor<uint8_t> mask({height, width});
  mask.fill(255);
  for (int64_t i = 0; i < holes; ++i)
    mask[static_cast<int64_t>(random.below(static_cast<uint32_t>(mask.size())))] = 0;
  const Tensor<uint8_t> found = eroded(mask, radius), expected = eroded_plainly(mask, radius);
  for (int64_t i = 0; i < mask.size(); ++i) RC_ASSERT(found[i] == expected[i]);
}

TEST(MaskCore, the_border_of_the_image_takes_nothing_away) {
  Tensor<uint8_t> mask({5, 7});
  mask.fill(1);
  const Tensor<uint8_t> core = eroded(mask, 3);
  for (const uint8_t v : core.values()) EXPECT_EQ(v, 1);
}

TEST(MaskCore, its_rim_is_a_sixtieth_of_the_width) {
  EXPECT_EQ(rim_of(1), 1);
  EXPECT_EQ(rim_of(60), 1);
  EXPECT_EQ(rim_of(89), 1);
  EXPECT_EQ(rim_of(90), 2);
  EXPECT_EQ(rim_of(480), 8);
  Tensor<uint8_t> mask({1, 120});
  for (int64_t x = 20; x < 40; ++x) mask[x] = 1;
  const Tensor<uint8_t> core = core_of(mask);
  for (int64_t x = 0; x < 120; ++x) EXPECT_EQ(core[x], x >= 22 && x < 38 ? 1 : 0) << x;
}

}  // namespace
}  // namespace traceflow::eval

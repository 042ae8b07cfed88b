#include "capture/formats/found_capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "support/refusal.h"

namespace traceflow {
namespace {

using testing::HasSubstr;

StoredImages choose(const std::set<int>& scales, int downscale) {
  return choose_images(
      "here", downscale, [&](int stored) { return scales.contains(stored); },
      [](int stored) { return "images_" + std::to_string(stored); });
}

TEST(StoredImages, are_the_smallest_that_can_be_filtered_to_what_is_wanted) {
  for (const int downscale : {1, 2, 3, 4, 6, 8, 64}) {
    const StoredImages images = choose({1, 2, 4}, downscale);
    EXPECT_EQ(images.stored, downscale % 4 == 0 ? 4 : downscale % 2 == 0 ? 2 : 1) << downscale;
    EXPECT_EQ(images.stored * images.factor, downscale);
    EXPECT_EQ(images.folder, "images_" + std::to_string(images.stored));
  }
  EXPECT_EQ(choose({4}, 8).stored, 4);
}

TEST(StoredImages, that_do_not_fit_are_named) {
  EXPECT_THAT(refusal_of([] {
                choose({4, 8}, 2);
              }),
              HasSubstr("here: found images_4, images_8, expected images at full size or at a divisor"));
  EXPECT_THAT(refusal_of([] { choose({}, 2); }), HasSubstr("here: found no images"));
}

}  // namespace
}  // namespace traceflow

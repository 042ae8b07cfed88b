#include "viz/capture_picture/capture_picture.h"

#include <gtest/gtest.h>

#include "capture/fake_capture.h"
#include "viz/capture_picture/inks.h"

namespace traceflow::viz {
namespace {

// Views of 12×8 pixels are as high as that with the 39 of their captions and gap, a map 460, the legend 26.
TEST(CapturePicture, holds_the_views_both_maps_and_their_legend) {
  NerfDsCapture fake(2);
  fake.cameras["000001_left"]["position"] = {0.2, 0, -0.9};
  fake.save();
  const Tensor<uint8_t> picture = capture_picture(load_capture(fake.path(), {}), {});
  constexpr int64_t maps = 8 + 39, legend = maps + 460;
  ASSERT_EQ(picture.shape(), (Shape{legend + 26, 1200, 3}));
  for (int view = 0; view < 4; ++view) {
    const Tensor<uint8_t> photograph = fake.image(view);
    const uint8_t* p = &photograph(3, 5, 0);
    EXPECT_TRUE(is(picture, 3, 201 * view + 5, {p[0], p[1], p[2]})) << view;
  }
  // In the scene the first camera is at x = 0, z = -1, the second at 0.1, -0.95, the test cameras at 0.05 and
  // 0.15, -1. From above 0.15 takes the 549 pixels between the margins, from the side 0.05.
  EXPECT_TRUE(is(picture, maps + 321, 24, time_ink(0)));
  EXPECT_TRUE(is(picture, maps + 138, 390, time_ink(1)));
  EXPECT_TRUE(is(picture, maps + 230, 603 + 573, time_ink(1)));
  EXPECT_TRUE(is(picture, maps + 321, 573 - 5, test_ink))
      << "the left side of the second test camera's square";
  EXPECT_TRUE(is(picture, maps + 230, 600, paper)) << "between the maps";
  bool has_mask_ink = false;
  for (int64_t x = 0; x < 1200; ++x) has_mask_ink |= is(picture, legend + 8, x, mask_ink);
  EXPECT_TRUE(has_mask_ink);
}

TEST(CapturePicture, a_camera_that_stands_apart_does_so_whatever_else_was_found) {
  NerfDsCapture fake(8);
  fake.cameras["000003_left"]["position"] = {90, 0, -1};
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  Finding blurred("one view is blurred", "blur"), apart("a camera stands apart", "camera-apart");
  blurred.views = apart.views = {"000003_left"};
  const auto bytes_with = [&](const std::vector<Finding>& findings) {
    const Tensor<uint8_t> picture = capture_picture(capture, findings);
    return std::vector<uint8_t>(picture.data(), picture.data() + picture.size());
  };
  const std::vector<uint8_t> expected = bytes_with({apart});
  EXPECT_TRUE(bytes_with({blurred, apart}) == expected);
  EXPECT_TRUE(bytes_with({apart, blurred}) == expected);
  EXPECT_FALSE(bytes_with({blurred}) == expected);
}

}  // namespace
}  // namespace traceflow::viz

#include "show/capture_picture/capture_picture.h"

#include <gtest/gtest.h>

#include "capture/fake_capture.h"

namespace traceflow::show {
namespace {

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
}  // namespace traceflow::show

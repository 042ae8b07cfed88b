#include "viz/capture_picture/view_tiles.h"

#include <gtest/gtest.h>

#include "capture/fake_capture.h"
#include "viz/capture_picture/inks.h"

namespace traceflow::viz {
namespace {

constexpr Ink blue{1, 2, 250};  // of no other picture and no mark

std::vector<Pixel> all_of(const Tensor<uint8_t>& picture, const Ink& ink) {
  std::vector<Pixel> found;
  for (int64_t y = 0; y < picture.dim(0); ++y) {
    for (int64_t x = 0; x < picture.dim(1); ++x) {
      if (is(picture, y, x, ink)) found.emplace_back(x, y);
    }
  }
  return found;
}

void paint_blue(const FakeCapture& fake, const std::string& id) {
  Tensor<uint8_t> pixels({8, 12, 3});
  fill_box({0, 0}, {12, 8}, blue, pixels);
  fake.write_image("rgb/1x/" + id + ".png", pixels);
}

// 24 of 120 views would leave this one out.
TEST(ViewTiles, a_marked_view_is_chosen_and_framed_in_red) {
  NerfDsCapture fake(60);
  fake.save();
  paint_blue(fake, "000003_right");
  const Capture capture = load_capture(fake.path(), {});
  const Tensor<uint8_t> plain = view_tiles(capture, {});
  EXPECT_TRUE(all_of(plain, blue).empty());
  EXPECT_TRUE(all_of(plain, alarm_ink).empty());
  const Tensor<uint8_t> tiles = view_tiles(capture, {{"000003_right", "blur"}});
  EXPECT_EQ(tiles.shape(), plain.shape());
  const std::vector<Pixel> inside = all_of(tiles, blue);
  ASSERT_EQ(inside.size(), 6U * 2) << "12×8 less the frame";
  const Pixel corner = inside.front();
  for (int64_t n = 1; n <= 3; ++n) {
    EXPECT_TRUE(is(tiles, corner.y - n, corner.x, alarm_ink));
    EXPECT_TRUE(is(tiles, corner.y, corner.x - n, alarm_ink));
  }
}

TEST(ViewTiles, many_marked_views_leave_room_for_others) {
  NerfDsCapture fake(60);
  fake.save();
  Marks marks;
  for (int t = 3; t < 53; t += 5) {
    const std::string id = "00000" + std::to_string(t) + "_right";
    paint_blue(fake, id);
    marks[id] = "blur";
  }
  const Capture capture = load_capture(fake.path(), {});
  EXPECT_EQ(all_of(view_tiles(capture, marks), blue).size(), 8U * 6 * 2);
}

TEST(ViewTiles, masks_are_outlined) {
  NerfDsCapture fake(2);
  Tensor<uint8_t> mask({8, 12});
  for (int64_t y = 1; y < 7; ++y) std::fill_n(&mask(y, 2), 8, uint8_t{255});
  fake.write_image("mask/1x/000000_left.png.png", mask);
  fake.save();
  const Tensor<uint8_t> tiles = view_tiles(load_capture(fake.path(), {}), {});
  const Tensor<uint8_t> photograph = fake.image(0);
  for (int64_t y = 0; y < 8; ++y) {
    for (int64_t x = 0; x < 12; ++x) {
      const bool on = y >= 1 && y < 7 && x >= 2 && x < 10;
      const bool inner = y >= 2 && y < 6 && x >= 3 && x < 9;
      const uint8_t* p = &photograph(y, x, 0);
      EXPECT_TRUE(is(tiles, y, x, on && !inner ? mask_ink : Ink{p[0], p[1], p[2]})) << y << " " << x;
    }
  }
}

// Pictures of a few bytes that promise 32,768 rows, or hold them.
TEST(ViewTiles, tall_pictures_are_fitted_into_a_cell_whether_they_can_be_decoded_or_not) {
  for (const bool whole : {true, false}) {
    NerfDsCapture fake(2);
    const std::filesystem::path file = fake.path() / "rgb/1x/000000_left.png";
    fake.write_image("rgb/1x/000000_left.png", Tensor<uint8_t>({32768, 1, 3}));
    if (!whole) std::filesystem::resize_file(file, 60);
    fake.save();
    const Tensor<uint8_t> tiles = view_tiles(load_capture(fake.path(), {}), {});
    EXPECT_EQ(tiles.dim(1), picture_width);
    EXPECT_LT(tiles.dim(0), 500);
    EXPECT_EQ(all_of(tiles, alarm_ink).empty(), whole) << "says that it cannot be read";
  }
}

TEST(ViewTiles, flat_pictures_that_cannot_be_decoded_have_room_for_the_words) {
  NerfDsCapture fake(1);
  fake.write_image("rgb/1x/000000_left.png", Tensor<uint8_t>({1, 300, 3}));
  std::filesystem::resize_file(fake.path() / "rgb/1x/000000_left.png", 60);
  fake.save();
  const Tensor<uint8_t> tiles = view_tiles(load_capture(fake.path(), {}), {});
  EXPECT_GT(all_of(tiles, alarm_ink).size(), 100U);
}

}  // namespace
}  // namespace traceflow::viz

#include "viz/drawing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace traceflow::viz {
namespace {

constexpr Ink white{255, 255, 255};

int64_t lit(const Tensor<uint8_t>& picture) {
  int64_t count = 0;
  for (int64_t i = 0; i < picture.size(); i += 3) count += picture[i] != 0 ? 1 : 0;
  return count;
}

TEST(Drawing, boxes_cover_what_they_say) {
  Tensor<uint8_t> picture({10, 12, 3});
  fill_box({2, 3}, {4, 5}, {1, 2, 3}, picture);
  EXPECT_EQ(lit(picture), 20);
  EXPECT_EQ(picture(3, 2, 0), 1);
  EXPECT_EQ(picture(7, 5, 2), 3);
  EXPECT_EQ(picture(8, 5, 2), 0);
  picture.fill(0);
  draw_box({2, 3}, {4, 5}, 1, white, picture);
  EXPECT_EQ(lit(picture), 2 * 4 + 2 * 3);
}

TEST(Drawing, what_lies_outside_is_left_out) {
  Tensor<uint8_t> picture({4, 4, 3});
  fill_box({-9, -9}, {3, 3}, white, picture);
  draw_line({-5, 1.5}, {20, 1.5}, white, picture);
  EXPECT_EQ(lit(picture), 4);
  draw_ring({100, 100}, 0, 5, white, picture);
  draw_line({0, 0}, {NAN, 3}, white, picture);
  write_text("abc", {3, -5}, white, picture);
  paste(Tensor<uint8_t>({9, 9, 3}), {-2, -2}, picture);
  EXPECT_EQ(lit(picture), 0);
}

TEST(Drawing, lines_join_their_ends_and_rings_keep_their_radii) {
  Tensor<uint8_t> picture({20, 20, 3});
  draw_line({3.5, 4.5}, {15.5, 9.5}, white, picture);
  EXPECT_EQ(picture(4, 3, 0), 255);
  EXPECT_EQ(picture(9, 15, 0), 255);
  EXPECT_EQ(lit(picture), 13);
  picture.fill(0);
  draw_ring({10, 10}, 3, 5, white, picture);
  EXPECT_EQ(picture(10, 10, 0), 0);
  EXPECT_EQ(picture(10, 14, 0), 255);
  EXPECT_EQ(picture(10, 15, 0), 0);
}

TEST(Drawing, letters_take_their_own_width) {
  const auto width = [](std::string_view text) {
    Tensor<uint8_t> picture({letter_height, 100, 3});
    write_text(text, {0, 0}, white, picture);
    int64_t right = 0;
    for (int64_t y = 0; y < picture.dim(0); ++y) {
      for (int64_t x = 0; x < picture.dim(1); ++x) right = std::max(right, picture(y, x, 0) != 0 ? x + 1 : 0);
    }
    return right;
  };
  EXPECT_LT(width("iiiiiiii"), width("mmmmmmmm"));
  EXPECT_LE(width("@@@@@@@@"), 8 * letter_width);
}

TEST(Drawing, every_letter_and_digit_looks_different) {
  std::vector<std::vector<uint8_t>> seen;
  for (const char c : std::string("abcdefghijklmnopqrstuvwxyz0123456789.,:-_+=/%() ")) {
    Tensor<uint8_t> picture({letter_height, letter_width, 3});
    write_text(std::string(1, c), {0, 0}, white, picture);
    EXPECT_EQ(lit(picture) == 0, c == ' ') << c;
    const std::vector<uint8_t> pixels(picture.values().begin(), picture.values().end());
    // O and 0, S and 5 differ too.
    EXPECT_EQ(std::count(seen.begin(), seen.end(), pixels), 0) << c;
    seen.push_back(pixels);
  }
}

}  // namespace
}  // namespace traceflow::viz

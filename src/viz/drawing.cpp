#include "viz/drawing.h"

#include <stb/stb_easy_font.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace traceflow::viz {

namespace {

void dot(int64_t x, int64_t y, const Ink& ink, Tensor<uint8_t>& picture) {
  if (x < 0 || y < 0 || y >= picture.dim(0) || x >= picture.dim(1)) return;
  uint8_t* pixel = &picture(y, x, 0);
  pixel[0] = ink.red;
  pixel[1] = ink.green;
  pixel[2] = ink.blue;
}

}  // namespace

void write_text(std::string_view text, const Pixel& at, const Ink& ink, Tensor<uint8_t>& picture) {
  struct Corner {
    float x, y, z;
    unsigned char colour[4];
  };
  std::array<std::array<Corner, 4>, 16> boxes{};  // a letter has 11 at most
  int64_t left = at.x;
  for (const char letter : text) {
    char one[] = {letter > ' ' && letter <= '~' ? letter : ' ', '\0'};
    const int count = stb_easy_font_print(0, 0, one, nullptr, boxes.data(), sizeof boxes);
    for (const auto& [first, right, last, below] : std::span(boxes).first(static_cast<size_t>(count)))
      fill_box({left + std::lround(first.x), at.y + std::lround(first.y)},
               {std::lround(last.x - first.x), std::lround(last.y - first.y)}, ink, picture);
    left += std::min<int64_t>(letter_width, stb_easy_font_width(one));
  }
}

void paste(const Tensor<uint8_t>& image, const Pixel& at, Tensor<uint8_t>& picture) {
  for (int64_t y = 0; y < image.dim(0); ++y) {
    for (int64_t x = 0; x < image.dim(1); ++x)
      dot(at.x + x, at.y + y, {image(y, x, 0), image(y, x, 1), image(y, x, 2)}, picture);
  }
}

void fill_box(const Pixel& at, const Pixel& size, const Ink& ink, Tensor<uint8_t>& picture) {
  for (int64_t y = at.y; y < at.y + size.y; ++y) {
    for (int64_t x = at.x; x < at.x + size.x; ++x) dot(x, y, ink, picture);
  }
}

void draw_box(const Pixel& at, const Pixel& size, int64_t thickness, const Ink& ink,
              Tensor<uint8_t>& picture) {
  fill_box(at, {size.x, thickness}, ink, picture);
  fill_box({at.x, at.y + size.y - thickness}, {size.x, thickness}, ink, picture);
  fill_box(at, {thickness, size.y}, ink, picture);
  fill_box({at.x + size.x - thickness, at.y}, {thickness, size.y}, ink, picture);
}

void draw_line(const Vec2<double>& from, const Vec2<double>& to, const Ink& ink, Tensor<uint8_t>& picture) {
  const Vec2<double> way = to - from;
  const double longest = std::max(std::abs(way.x), std::abs(way.y));
  if (!std::isfinite(longest)) return;
  const auto steps = std::max<int64_t>(1, std::lround(longest));
  for (int64_t i = 0; i <= steps; ++i) {
    const Vec2<double> at = from + way * (static_cast<double>(i) / static_cast<double>(steps));
    dot(std::lround(std::floor(at.x)), std::lround(std::floor(at.y)), ink, picture);
  }
}

void draw_ring(const Vec2<double>& centre, double inner, double outer, const Ink& ink,
               Tensor<uint8_t>& picture) {
  const auto left = std::lround(std::floor(centre.x - outer)),
             right = std::lround(std::ceil(centre.x + outer));
  const auto top = std::lround(std::floor(centre.y - outer)),
             bottom = std::lround(std::ceil(centre.y + outer));
  for (int64_t y = top; y <= bottom; ++y) {
    for (int64_t x = left; x <= right; ++x) {
      const double away =
          length(Vec2<double>(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5) - centre);
      if (away >= inner && away <= outer) dot(x, y, ink, picture);
    }
  }
}

}  // namespace traceflow::viz

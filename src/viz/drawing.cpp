#include "viz/drawing.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace traceflow::viz {

namespace {

// The highest of 15 bits is the left dot of the top row.
constexpr std::array<uint16_t, 26> letters = {
    0b010101111101101, 0b110101110101110, 0b011100100100011, 0b110101101101110, 0b111100110100111,
    0b111100110100100, 0b011100101101011, 0b101101111101101, 0b111010010010111, 0b001001001101010,
    0b101101110101101, 0b100100100100111, 0b101111111101101, 0b110101101101101, 0b010101101101010,
    0b110101110100100, 0b010101101111011, 0b110101110101101, 0b011100010001110, 0b111010010010010,
    0b101101101101111, 0b101101101101010, 0b101101111111101, 0b101101010101101, 0b101101010010010,
    0b111001010100111};
constexpr std::array<uint16_t, 10> digits = {
    0b111101101101111, 0b010110010010111, 0b111001111100111, 0b111001111001111, 0b101101111001001,
    0b111100111001111, 0b111100111101111, 0b111001001010010, 0b111101111101111, 0b111101111001111};

uint16_t glyph_of(char c) {
  if (c >= 'a' && c <= 'z') return letters[static_cast<size_t>(c - 'a')];
  if (c >= 'A' && c <= 'Z') return letters[static_cast<size_t>(c - 'A')];
  if (c >= '0' && c <= '9') return digits[static_cast<size_t>(c - '0')];
  switch (c) {
    case '.':
      return 0b000000000000010;
    case ',':
      return 0b000000000010100;
    case ':':
      return 0b000010000010000;
    case '-':
      return 0b000000111000000;
    case '_':
      return 0b000000000000111;
    case '+':
      return 0b000010111010000;
    case '=':
      return 0b000111000111000;
    case '/':
      return 0b001001010100100;
    case '%':
      return 0b101001010100101;
    case '(':
      return 0b001010010010001;
    case ')':
      return 0b100010010010100;
    default:
      return 0;
  }
}

void dot(int64_t x, int64_t y, const Ink& ink, Tensor<uint8_t>& picture) {
  if (x < 0 || y < 0 || y >= picture.dim(0) || x >= picture.dim(1)) return;
  uint8_t* pixel = &picture(y, x, 0);
  pixel[0] = ink.red;
  pixel[1] = ink.green;
  pixel[2] = ink.blue;
}

}  // namespace

void write_text(std::string_view text, const Pixel& at, const Ink& ink, Tensor<uint8_t>& picture) {
  int64_t left = at.x;
  for (const char letter : text) {
    const uint16_t glyph = glyph_of(letter);
    for (int64_t bit = 0; bit < 15; ++bit) {
      if (((glyph >> (14 - bit)) & 1) != 0)
        fill_box({left + bit % 3 * 2, at.y + bit / 3 * 2}, {2, 2}, ink, picture);
    }
    left += letter_width;
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

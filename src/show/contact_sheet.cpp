#include "show/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "files/png.h"

namespace traceflow::show {

namespace {

constexpr std::array<const char*, 9> titles = {"photograph", "render", "difference", "diffuse", "specular",
                                               "tint",       "normal", "depth",      "alpha"};
constexpr std::array<Layer, 6> shown_layers = {Layer::diffuse, Layer::specular, Layer::tint,
                                               Layer::normal,  Layer::depth,    Layer::alpha};
constexpr int64_t gap = 3;
constexpr int64_t title_height = 16;
constexpr uint8_t paper = 255, ink = 40;
constexpr float difference_gain = 3;

// Letters a to z, 3 wide and 5 high, the top row's left pixel in the highest of 15 bits.
constexpr std::array<uint16_t, 26> glyphs = {
    0b010101111101101, 0b110101110101110, 0b011100100100011, 0b110101101101110, 0b111100110100111,
    0b111100110100100, 0b011100101101011, 0b101101111101101, 0b111010010010111, 0b001001001101010,
    0b101101110101101, 0b100100100100111, 0b101111111101101, 0b110101101101101, 0b010101101101010,
    0b110101110100100, 0b010101101111011, 0b110101110101101, 0b011100010001110, 0b111010010010010,
    0b101101101101111, 0b101101101101010, 0b101101111111101, 0b101101010101101, 0b101101010010010,
    0b111001010100111};

// Every pixel of a glyph is 2×2.
void write_text(std::string_view text, int64_t top, int64_t left, Tensor<uint8_t>& sheet) {
  for (const char letter : text) {
    for (int64_t bit = 0; bit < 15; ++bit) {
      if (((glyphs[static_cast<size_t>(letter - 'a')] >> (14 - bit)) & 1) == 0) continue;
      for (int64_t k = 0; k < 4; ++k) {
        const int64_t y = top + bit / 3 * 2 + k / 2, x = left + bit % 3 * 2 + k % 2;
        if (y < sheet.dim(0) && x < sheet.dim(1)) std::fill_n(&sheet(y, x, 0), 3, ink);
      }
    }
    left += 8;
  }
}

void paste(const Tensor<uint8_t>& image, int64_t top, int64_t left, Tensor<uint8_t>& sheet) {
  for (int64_t y = 0; y < image.dim(0); ++y) {
    std::copy(image.row(y), image.row(y) + image.row_size(), &sheet(top + y, left, 0));
  }
}

}  // namespace

Tensor<float> difference(const Tensor<float>& a, const Tensor<float>& b) {
  Tensor<float> result(a.shape());
  for (int64_t i = 0; i < a.size(); ++i) result[i] = difference_gain * std::abs(a[i] - b[i]);
  return result;
}

void ContactSheet::add(const Tensor<float>& photograph, const Frame& frame) {
  require(photograph.shape() == frame.colour.shape(), "photograph and render have one shape",
          photograph.shape().to_string() + " and " + frame.colour.shape().to_string());
  const Tensor<float> render = layer_values(frame, Layer::rgb, 1);
  std::vector<Tensor<uint8_t>> row = {to_8bit(photograph), to_8bit(render),
                                      to_8bit(difference(photograph, render))};
  for (const Layer layer : shown_layers)
    row.push_back(in_colour(painter_.paint(layer, layer_values(frame, layer, 1))));
  for (Tensor<uint8_t>& cell : row) cell = shrink(cell, cell_width_);
  rows_.push_back(std::move(row));
}

void ContactSheet::write(const std::filesystem::path& path) const {
  require(!rows_.empty(), "a contact sheet has a row");
  int64_t width = 0, height = title_height;
  for (const auto& row : rows_) {
    width = std::max(width, row[0].dim(1));
    height += row[0].dim(0) + gap;
  }
  Tensor<uint8_t> sheet(Shape{height, static_cast<int64_t>(titles.size()) * (width + gap) - gap, 3});
  sheet.fill(paper);
  for (size_t column = 0; column < titles.size(); ++column) {
    const int64_t left = static_cast<int64_t>(column) * (width + gap);
    write_text(titles[column], 3, left + 1, sheet);
    int64_t top = title_height;
    for (const auto& row : rows_) {
      paste(row[column], top, left, sheet);
      top += row[column].dim(0) + gap;
    }
  }
  write_png(path, sheet);
}

}  // namespace traceflow::show

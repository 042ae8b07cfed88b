#include "viz/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "files/png.h"
#include "viz/drawing.h"

namespace traceflow::viz {

namespace {

constexpr std::array<const char*, 9> titles = {"photograph", "render", "difference", "diffuse", "specular",
                                               "tint",       "normal", "depth",      "alpha"};
constexpr std::array<Layer, 6> shown_layers = {Layer::diffuse, Layer::specular, Layer::tint,
                                               Layer::normal,  Layer::depth,    Layer::alpha};
constexpr int64_t gap = 3;
constexpr int64_t title_height = 16;
constexpr uint8_t paper = 255;
constexpr Ink ink{40, 40, 40};
constexpr float difference_gain = 3;

}  // namespace

Tensor<float> difference(const Tensor<float>& photograph, const Tensor<float>& render,
                         const Tensor<uint8_t>& known) {
  Tensor<float> result(photograph.shape());
  for (int64_t i = 0; i < result.size(); ++i) {
    if (known.empty() || known[i / 3] != 0) result[i] = difference_gain * std::abs(photograph[i] - render[i]);
  }
  return result;
}

void ContactSheet::add(const Tensor<float>& photograph, const Frame& frame, const Tensor<uint8_t>& known) {
  require(photograph.shape() == frame.colour.shape(), "photograph and render have one shape",
          photograph.shape().to_string() + " and " + frame.colour.shape().to_string());
  const Tensor<float> render = layer_values(frame, Layer::rgb, 1);
  std::vector<Tensor<uint8_t>> row = {to_8bit(photograph), to_8bit(render),
                                      to_8bit(difference(photograph, render, known))};
  for (const Layer layer : shown_layers)
    row.push_back(in_colour(painter_.paint(layer, layer_values(frame, layer, 1))));
  for (Tensor<uint8_t>& cell : row) cell = shrink(cell, cell_width_);
  rows_.push_back(std::move(row));
}

void ContactSheet::write(const std::filesystem::path& path) const {
  require(!rows_.empty(), "a contact sheet has a row");
  // Columns are at least as wide as the longest title.
  int64_t width = letter_width * static_cast<int64_t>(std::string_view(titles[0]).size());
  int64_t height = title_height;
  for (const auto& row : rows_) {
    width = std::max(width, row[0].dim(1));
    height += row[0].dim(0) + gap;
  }
  Tensor<uint8_t> sheet(Shape{height, static_cast<int64_t>(titles.size()) * (width + gap) - gap, 3});
  sheet.fill(paper);
  for (size_t column = 0; column < titles.size(); ++column) {
    const int64_t left = static_cast<int64_t>(column) * (width + gap);
    write_text(titles[column], {left + 1, 3}, ink, sheet);
    int64_t top = title_height;
    for (const auto& row : rows_) {
      paste(row[column], {left, top}, sheet);
      top += row[column].dim(0) + gap;
    }
  }
  write_png(path, sheet);
}

}  // namespace traceflow::viz

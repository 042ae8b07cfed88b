#pragma once

#include <filesystem>

#include "viz/picture.h"

namespace traceflow::viz {

// One picture with a row for each view: photograph, render, difference (times three), diffuse, specular,
// tint, normal, depth and alpha side by side, with titles.
class ContactSheet {
 public:
  // cell_width: width of one cell in pixels.
  explicit ContactSheet(int64_t cell_width) : cell_width_(cell_width) {}

  // photograph and its known pixels (H×W, may be empty): on the host; the frame is on any device.
  void add(const Tensor<float>& photograph, const Frame& frame, const Tensor<uint8_t>& known = {});
  // Writes atomically. There must be a row.
  void write(const std::filesystem::path& path) const;

 private:
  int64_t cell_width_;
  Painter painter_;
  std::vector<std::vector<Tensor<uint8_t>>> rows_;
};

// 3 · |photograph − render|, so that small differences are visible; 0 where the photograph is unknown (known:
// H×W, may be empty).
Tensor<float> difference(const Tensor<float>& photograph, const Tensor<float>& render,
                         const Tensor<uint8_t>& known);

}  // namespace traceflow::viz

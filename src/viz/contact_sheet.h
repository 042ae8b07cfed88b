#pragma once

#include <filesystem>

#include "viz/picture.h"

namespace traceflow::viz {

// One picture of everything: a row for each view, with photograph, render, difference (three times as
// strong), diffuse, specular, tint, normal, depth and alpha side by side under their names.
class ContactSheet {
 public:
  // cell_width: columns of one picture, pixels.
  explicit ContactSheet(int64_t cell_width) : cell_width_(cell_width) {}

  // photograph, and what of it is known (H×W, may be empty): on the host; the frame is on any device.
  void add(const Tensor<float>& photograph, const Frame& frame, const Tensor<uint8_t>& known = {});
  // Written atomically. There must be a row.
  void write(const std::filesystem::path& path) const;

 private:
  int64_t cell_width_;
  Painter painter_;
  std::vector<std::vector<Tensor<uint8_t>>> rows_;
};

// |photograph − render|, three times as strong, to be seen; 0 where the photograph is not known (H×W, may be
// empty).
Tensor<float> difference(const Tensor<float>& photograph, const Tensor<float>& render,
                         const Tensor<uint8_t>& known);

}  // namespace traceflow::viz

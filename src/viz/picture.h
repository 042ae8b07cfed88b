#pragma once

#include <limits>
#include <optional>

#include "viz/colour_map.h"
#include "viz/layers.h"

namespace traceflow::viz {

// How numbers are mapped to colours.
struct PaintOptions {
  // For all layers with one number per pixel. Absent: the ramp for depths, distortion and differences, grey
  // for tint and alpha.
  std::optional<ColourMap> map = std::nullopt;
  float exposure = 0;  // stops: light layers and differences are multiplied by 2^exposure
  // How far the ranges of depths and distortion move towards each picture's own range: 0 keeps the first
  // picture's range, so that a video does not flicker; 1 uses each picture's own.
  float follow = 0;
};

// Converts layers to 8-bit pictures. Colours, tint and alpha are unchanged. Normals are (n + 1)/2 of world x,
// y, z. Depths go from near (bright) to far (dark) by inverse depth, distortion from none (dark) to much
// (bright); both are black where there is no value.
class Painter {
 public:
  explicit Painter(const PaintOptions& options = {}) : options_(options) {}

  const PaintOptions& options() const { return options_; }
  PaintOptions& options() { return options_; }

  Tensor<uint8_t> paint(Layer layer, const Tensor<float>& values);
  // Paints difference_values, H×W. At exposure 0 the map ends at a difference of 0.25.
  Tensor<uint8_t> paint_difference(const Tensor<float>& values) const;

 private:
  struct Range {
    float low, high;
  };
  static std::optional<Range> range_of(const Tensor<float>& values);
  // Updates the range by the values and returns it.
  Range followed(std::optional<Range>& range, const Tensor<float>& values) const;
  Tensor<uint8_t> mapped(const Tensor<float>& values, Range range, bool zero_is_none) const;

  PaintOptions options_;
  std::optional<Range> inverse_depth_, distortion_;
};

// Averages the image down to at most `width` columns and `height` rows. An image that fits is unchanged.
// H×W×3.
Tensor<uint8_t> shrink(const Tensor<uint8_t>& image, int64_t width,
                       int64_t height = std::numeric_limits<int64_t>::max());

// Joins two pictures (H×W×3) of equal height, left and right. Throws InputError if the heights differ.
Tensor<uint8_t> side_by_side(const Tensor<uint8_t>& left, const Tensor<uint8_t>& right);

// Converts grey (H×W) to three channels; three channels are unchanged.
Tensor<uint8_t> in_colour(const Tensor<uint8_t>& image);

}  // namespace traceflow::viz

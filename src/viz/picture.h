#pragma once

#include <limits>
#include <optional>

#include "viz/colour_map.h"
#include "viz/layers.h"

namespace traceflow::viz {

// How numbers become colours.
struct PaintOptions {
  // For every layer of numbers. Absent: the ramp for depths, distortion and differences, grey for tint and
  // alpha.
  std::optional<ColourMap> map = std::nullopt;
  float exposure = 0;  // stops: layers that are light, and differences, are brightened by 2^exposure
  // How far the ranges of depths and distortion go with each picture from where they are to the picture's
  // own: 0 not at all, so that the first picture's stay and a film does not flicker; 1 all the way.
  float follow = 0;
};

// Turns layers into 8-bit pictures for the eye. Colours, tint and alpha are shown as they are; normals as (n
// + 1)/2 of world x, y, z; depths from near (bright) to far (dark) by inverse depth, distortion from none
// (dark) to much (bright), black where there is none.
class Painter {
 public:
  explicit Painter(const PaintOptions& options = {}) : options_(options) {}

  const PaintOptions& options() const { return options_; }
  PaintOptions& options() { return options_; }

  Tensor<uint8_t> paint(Layer layer, const Tensor<float>& values);
  // difference_values, H×W. At exposure 0 the map ends at a difference of a quarter.
  Tensor<uint8_t> paint_difference(const Tensor<float>& values) const;

 private:
  struct Range {
    float low, high;
  };
  static std::optional<Range> range_of(const Tensor<float>& values);
  // The range to paint with, after it has followed the values.
  Range followed(std::optional<Range>& range, const Tensor<float>& values) const;
  Tensor<uint8_t> mapped(const Tensor<float>& values, Range range, bool zero_is_none) const;

  PaintOptions options_;
  std::optional<Range> inverse_depth_, distortion_;
};

// Averages to fit `width` columns and `height` rows; an image that fits stays as it is. H×W×3.
Tensor<uint8_t> shrink(const Tensor<uint8_t>& image, int64_t width,
                       int64_t height = std::numeric_limits<int64_t>::max());

// Grey (H×W) to three channels; three stay.
Tensor<uint8_t> in_colour(const Tensor<uint8_t>& image);

}  // namespace traceflow::viz

#pragma once

#include <optional>

#include "show/layers.h"

namespace traceflow::show {

// Turns layers into 8-bit pictures for the eye. Colours, tint and alpha are shown as they are; normals as (n
// + 1)/2 of world x, y, z; depths from near (bright) to far (dark) by inverse depth, distortion from none
// (dark) to much (bright), black where there is none. The ranges of depth and distortion are the first
// frame's, so that a sequence does not flicker.
class Painter {
 public:
  Tensor<uint8_t> paint(Layer layer, const Tensor<float>& values);

 private:
  struct Range {
    float low, high;
  };
  static Range range_of(const Tensor<float>& values);
  static Tensor<uint8_t> ramp(const Tensor<float>& values, Range range);

  std::optional<Range> inverse_depth_, distortion_;
};

// A colour of the ramp that depths are shown in: dark violet (0) over green to light yellow (1).
Vec3<float> ramp_colour(float value);

// Averages to fit `width` columns; an image that is narrower stays as it is. H×W×3.
Tensor<uint8_t> shrink(const Tensor<uint8_t>& image, int64_t width);

// Grey (H×W) to three channels; three stay.
Tensor<uint8_t> in_colour(const Tensor<uint8_t>& image);

}  // namespace traceflow::show

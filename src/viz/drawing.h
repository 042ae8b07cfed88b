#pragma once

#include <string_view>

#include "base/tensor.h"
#include "math/types.h"

// Draws on 8-bit pictures, H×W×3. Parts outside the picture are clipped.
namespace traceflow::viz {

struct Ink {
  uint8_t red = 0, green = 0, blue = 0;
};

using Pixel = Vec2<int64_t>;  // x to the right, y down

// Characters of ASCII; others are blank. Each takes at most letter_width pixels. at: the upper left corner.
inline constexpr int64_t letter_width = 8, letter_height = 10;
void write_text(std::string_view text, const Pixel& at, const Ink& ink, Tensor<uint8_t>& picture);

void paste(const Tensor<uint8_t>& image, const Pixel& at, Tensor<uint8_t>& picture);
void fill_box(const Pixel& at, const Pixel& size, const Ink& ink, Tensor<uint8_t>& picture);
// The border of a box, drawn inside it.
void draw_box(const Pixel& at, const Pixel& size, int64_t thickness, const Ink& ink,
              Tensor<uint8_t>& picture);
void draw_line(const Vec2<double>& from, const Vec2<double>& to, const Ink& ink, Tensor<uint8_t>& picture);
// Fills the pixels whose distance from the centre is between the radii.
void draw_ring(const Vec2<double>& centre, double inner, double outer, const Ink& ink,
               Tensor<uint8_t>& picture);

}  // namespace traceflow::viz

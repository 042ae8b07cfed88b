#include "capture/noise.h"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace traceflow {

namespace {

// A coefficient's magnitude is a multiple of 0.5; twice the magnitude is at most 510.
using Histogram = std::array<int64_t, 511>;

// The median of values that were rounded to whole numbers. Each number represents all values that round to
// it.
double median_of(const Histogram& histogram, int64_t count) {
  int64_t below = 0;
  size_t i = 0;
  while (2 * (below + histogram[i]) < count) below += histogram[i++];
  const double within =
      (static_cast<double>(count) / 2 - static_cast<double>(below)) / static_cast<double>(histogram[i]);
  // Magnitude 0 represents a range half as wide as the others.
  return i == 0 ? within / 2 : static_cast<double>(i) - 0.5 + within;
}

}  // namespace

std::optional<double> noise_deviation(const Tensor<uint8_t>& picture, const Tensor<uint8_t>& mask) {
  constexpr int64_t enough = 100;
  constexpr double median_of_normal = 0.67448975;  // of |x|, in standard deviations
  const int64_t channels = picture.dim(2);
  Histogram histogram{};
  int64_t count = 0;
  for (int64_t y = 0; y + 1 < picture.dim(0); y += 2) {
    for (int64_t x = 0; x + 1 < picture.dim(1); x += 2) {
      if (!mask.empty() &&
          (mask(y, x) == 0 || mask(y, x + 1) == 0 || mask(y + 1, x) == 0 || mask(y + 1, x + 1) == 0))
        continue;
      for (int64_t c = 0; c < channels; ++c) {
        const std::array<int, 4> block{picture(y, x, c), picture(y, x + 1, c), picture(y + 1, x, c),
                                       picture(y + 1, x + 1, c)};
        const auto [least, most] = std::ranges::minmax_element(block);
        if (*least == 0 || *most == 255) continue;
        ++histogram[static_cast<size_t>(std::abs(block[0] - block[1] - block[2] + block[3]))];
        ++count;
      }
    }
  }
  if (count < enough) return std::nullopt;
  return median_of(histogram, count) / 2 / median_of_normal;
}

}  // namespace traceflow

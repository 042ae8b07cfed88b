#include "capture/sharpness.h"

namespace traceflow {

Tensor<uint8_t> grey_of(const Tensor<uint8_t>& picture) {
  const int64_t channels = picture.dim(2);
  if (channels < 3) return picture;
  Tensor<uint8_t> grey({picture.dim(0), picture.dim(1), 1});
  for (int64_t i = 0; i < grey.size(); ++i) {
    const uint8_t* c = picture.data() + i * channels;
    grey[i] = static_cast<uint8_t>((77 * c[0] + 150 * c[1] + 29 * c[2] + 128) >> 8);
  }
  return grey;
}

double sharpness(const Tensor<uint8_t>& grey) {
  const int64_t height = grey.dim(0), width = grey.dim(1);
  if (height < 3 || width < 3) return 0;
  int64_t sum = 0, sum_of_squares = 0;
  for (int64_t y = 1; y + 1 < height; ++y) {
    const uint8_t *above = grey.data() + (y - 1) * width, *row = above + width, *below = row + width;
    for (int64_t x = 1; x + 1 < width; ++x) {
      const int laplacian = above[x] + below[x] + row[x - 1] + row[x + 1] - 4 * row[x];
      sum += laplacian;
      sum_of_squares += static_cast<int64_t>(laplacian) * laplacian;
    }
  }
  const auto count = static_cast<double>((height - 2) * (width - 2));
  const double mean = static_cast<double>(sum) / count;
  return static_cast<double>(sum_of_squares) / count - mean * mean;
}

}  // namespace traceflow

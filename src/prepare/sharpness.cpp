#include "prepare/sharpness.h"

namespace traceflow::prepare {

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

}  // namespace traceflow::prepare

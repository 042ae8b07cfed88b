#include "train/box_mean.h"

#include <algorithm>

#include "base/parallel.h"

namespace traceflow {

Tensor<float> box_mean(const Tensor<float>& image, int64_t half_window) {
  const int64_t height = image.dim(0), width = image.dim(1);
  const int64_t numbers = image.size() / std::max<int64_t>(1, height * width);
  const auto first = [&](int64_t at) { return std::max<int64_t>(0, at - half_window); };
  const auto last = [&](int64_t at, int64_t size) { return std::min(size - 1, at + half_window); };
  Tensor<float> along(image.shape()), mean(image.shape());
  parallel_for("box mean: rows", height, [&](int64_t y) {
    for (int64_t x = 0; x < width; ++x) {
      float* const sum = along.data() + (y * width + x) * numbers;
      for (int64_t at = first(x); at <= last(x, width); ++at) {
        const float* const from = image.data() + (y * width + at) * numbers;
        for (int64_t c = 0; c < numbers; ++c) sum[c] += from[c];
      }
    }
  });
  parallel_for("box mean: columns", height, [&](int64_t y) {
    const int64_t rows = last(y, height) - first(y) + 1;
    for (int64_t at = first(y); at <= last(y, height); ++at) {
      const float* const from = along.data() + at * width * numbers;
      float* const sum = mean.data() + y * width * numbers;
      for (int64_t k = 0; k < width * numbers; ++k) sum[k] += from[k];
    }
    for (int64_t x = 0; x < width; ++x) {
      const int64_t columns = last(x, width) - first(x) + 1;
      for (int64_t c = 0; c < numbers; ++c)
        mean[(y * width + x) * numbers + c] /= static_cast<float>(rows * columns);
    }
  });
  return mean;
}

}  // namespace traceflow

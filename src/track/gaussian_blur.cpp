#include "track/gaussian_blur.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"

namespace traceflow {

namespace {

// In pixels; x1 and y1 are exclusive.
struct Box {
  int64_t x0, y0, x1, y1;
};

// The smallest box that contains all pixels with a number other than 0.
Box box_of(const Tensor<float>& image, int64_t height, int64_t width, int64_t numbers) {
  Box box{width, height, 0, 0};
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      const float* const values = image.data() + (y * width + x) * numbers;
      if (std::all_of(values, values + numbers, [](float v) { return v == 0; })) continue;
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1), y + 1};
    }
  }
  return box;
}

}  // namespace

void gaussian_blur(Tensor<float>& image, Tensor<float>& along, int64_t height, int64_t width, int64_t numbers,
                   double sigma) {
  if (sigma < 0.3) return;
  const auto half_window = static_cast<int64_t>(std::ceil(2.5 * sigma));
  std::vector<float> taps;
  float sum = 0;
  for (int64_t k = -half_window; k <= half_window; ++k) {
    taps.push_back(static_cast<float>(std::exp(-0.5 * static_cast<double>(k * k) / (sigma * sigma))));
    sum += taps.back();
  }
  for (float& tap : taps) tap /= sum;
  along.resize(image.shape());
  const Box box = box_of(image, height, width, numbers);
  const int64_t left = std::max<int64_t>(0, box.x0 - half_window),
                right = std::min(width, box.x1 + half_window);
  const int64_t top = std::max<int64_t>(0, box.y0 - half_window),
                bottom = std::min(height, box.y1 + half_window);
  const auto pass = [&](const Tensor<float>& from, Tensor<float>& to, int64_t first, int64_t last,
                        bool down) {
    parallel_blocks("track: blur", last - first, 4, [&](int64_t begin, int64_t end) {
      for (int64_t y = first + begin; y < first + end; ++y) {
        for (int64_t x = left; x < right; ++x) {
          float* const sums = to.data() + (y * width + x) * numbers;
          std::fill_n(sums, numbers, 0.0F);
          for (int64_t k = -half_window; k <= half_window; ++k) {
            const int64_t row = down ? std::clamp<int64_t>(y + k, 0, height - 1) : y;
            const int64_t column = down ? x : std::clamp<int64_t>(x + k, 0, width - 1);
            if (row < box.y0 || row >= box.y1) continue;
            const float* const values = from.data() + (row * width + column) * numbers;
            const float tap = taps[static_cast<size_t>(k + half_window)];
            for (int64_t n = 0; n < numbers; ++n) sums[n] += tap * values[n];
          }
        }
      }
    });
  };
  if (box.y0 >= box.y1) return;
  pass(image, along, box.y0, box.y1, false);
  pass(along, image, top, bottom, true);
}

}  // namespace traceflow

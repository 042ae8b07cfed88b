#include "capture/lens/resample.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace traceflow {

namespace {

// The source pixels of one target pixel, along one side, and their weights (sum 1).
struct Taps {
  int64_t first = 0;
  std::vector<float> weight;
};

Taps area_taps(int64_t target, double step, int64_t size) {
  const double begin = std::min(static_cast<double>(target) * step, static_cast<double>(size) - 1);
  const double end =
      std::clamp(static_cast<double>(target + 1) * step, begin + 1e-9, static_cast<double>(size));
  Taps taps{static_cast<int64_t>(begin), {}};
  for (int64_t i = taps.first; static_cast<double>(i) < end && i < size; ++i) {
    const double overlap =
        std::min(end, static_cast<double>(i + 1)) - std::max(begin, static_cast<double>(i));
    taps.weight.push_back(static_cast<float>(overlap / (end - begin)));
  }
  return taps;
}

// The two neighbours of a position along one side; the border is replicated.
struct Between {
  int64_t first, second;
  float fraction;  // weight of the second
};

Between between(double position, int64_t size) {
  const double at = std::clamp(position - 0.5, 0.0, static_cast<double>(size - 1));
  const auto first = static_cast<int64_t>(at);
  return {first, std::min(first + 1, size - 1), static_cast<float>(at - static_cast<double>(first))};
}

Taps bilinear_taps(double position, int64_t size) {
  const Between b = between(position, size);
  if (b.first == b.second) return {b.first, {1.0F}};
  return {b.first, {1 - b.fraction, b.fraction}};
}

std::vector<Taps> side_taps(int64_t targets, double step, int64_t size) {
  std::vector<Taps> taps;
  for (int64_t t = 0; t < targets; ++t) {
    taps.push_back(step >= 1 ? area_taps(t, step, size)
                             : bilinear_taps((static_cast<double>(t) + 0.5) * step, size));
  }
  return taps;
}

Tensor<float> straighten_with(const Tensor<float>& image, const Lens& lens, double zoom, bool nearest) {
  const int64_t height = image.dim(0), width = image.dim(1), channels = image.dim(2);
  Tensor<float> result(image.shape());
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      const Vec2<double> pixel(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      const Vec2<double> from = lens.pixel_from_ideal((pixel - lens.centre) / (zoom * lens.focal));
      float* to = &result(y, x, 0);
      if (nearest) {
        const auto i = static_cast<int64_t>(std::clamp(from.x, 0.0, static_cast<double>(width - 1)));
        const auto j = static_cast<int64_t>(std::clamp(from.y, 0.0, static_cast<double>(height - 1)));
        std::copy_n(&image(j, i, 0), channels, to);
        continue;
      }
      const Between i = between(from.x, width), j = between(from.y, height);
      const float* corners[4] = {&image(j.first, i.first, 0), &image(j.first, i.second, 0),
                                 &image(j.second, i.first, 0), &image(j.second, i.second, 0)};
      for (int64_t c = 0; c < channels; ++c) {
        const float above = corners[0][c] + i.fraction * (corners[1][c] - corners[0][c]);
        const float below = corners[2][c] + i.fraction * (corners[3][c] - corners[2][c]);
        to[c] = above + j.fraction * (below - above);
      }
    }
  }
  return result;
}

}  // namespace

Tensor<float> resample(const Tensor<float>& image, const Grid& grid) {
  const int64_t height = image.dim(0), width = image.dim(1), channels = image.dim(2);
  if (grid.width == width && grid.height == height && grid.step_x == 1 && grid.step_y == 1) return image;
  const std::vector<Taps> columns = side_taps(grid.width, grid.step_x, width);
  const std::vector<Taps> rows = side_taps(grid.height, grid.step_y, height);
  Tensor<float> narrow({height, grid.width, channels});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < grid.width; ++x) {
      const Taps& taps = columns[static_cast<size_t>(x)];
      for (size_t i = 0; i < taps.weight.size(); ++i) {
        const float* from = &image(y, taps.first + static_cast<int64_t>(i), 0);
        for (int64_t c = 0; c < channels; ++c) narrow(y, x, c) += taps.weight[i] * from[c];
      }
    }
  }
  Tensor<float> result({grid.height, grid.width, channels});
  for (int64_t y = 0; y < grid.height; ++y) {
    const Taps& taps = rows[static_cast<size_t>(y)];
    float* to = result.row(y);
    for (size_t j = 0; j < taps.weight.size(); ++j) {
      const float* from = narrow.row(taps.first + static_cast<int64_t>(j));
      for (int64_t k = 0; k < grid.width * channels; ++k) to[k] += taps.weight[j] * from[k];
    }
  }
  return result;
}

Tensor<float> straighten(const Tensor<float>& image, const Lens& lens, double zoom) {
  return straighten_with(image, lens, zoom, false);
}

Tensor<float> straighten_nearest(const Tensor<float>& image, const Lens& lens, double zoom) {
  return straighten_with(image, lens, zoom, true);
}

}  // namespace traceflow

#include "eval/mask_core.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"

namespace traceflow::eval {

namespace {

constexpr int64_t rims_in_width = 60;

// For every pixel, the distance to the nearest pixel outside the mask in its column, at most radius + 1.
Tensor<int32_t> distances_in_columns(const Tensor<uint8_t>& mask, int64_t radius) {
  const int64_t height = mask.dim(0), width = mask.dim(1);
  const auto farthest = static_cast<int32_t>(radius + 1);
  Tensor<int32_t> distance(mask.shape());
  parallel_for("metrics: distances in columns", width, [&](int64_t x) {
    int32_t since = farthest;
    for (int64_t y = 0; y < height; ++y) {
      since = mask(y, x) == 0 ? 0 : std::min(since + 1, farthest);
      distance(y, x) = since;
    }
    since = farthest;
    for (int64_t y = height - 1; y >= 0; --y) {
      since = mask(y, x) == 0 ? 0 : std::min(since + 1, farthest);
      distance(y, x) = std::min(distance(y, x), since);
    }
  });
  return distance;
}

}  // namespace

int64_t rim_of(int64_t image_width) {
  return std::max<int64_t>(1, (image_width + rims_in_width / 2) / rims_in_width);
}

Tensor<uint8_t> eroded(const Tensor<uint8_t>& mask, int64_t radius) {
  const int64_t height = mask.dim(0), width = mask.dim(1);
  // At a horizontal distance of dx the disk's half height is half_height[dx].
  std::vector<int32_t> half_height;
  for (int64_t dx = 0; dx <= radius; ++dx) {
    half_height.push_back(static_cast<int32_t>(std::sqrt(static_cast<double>(radius * radius - dx * dx))));
  }
  const Tensor<int32_t> distance = distances_in_columns(mask, radius);
  Tensor<uint8_t> core(mask.shape());
  parallel_for(
      "metrics: erode", height,
      [&](int64_t y) {
        for (int64_t x = 0; x < width; ++x) {
          bool inside = mask(y, x) != 0;
          for (int64_t dx = 0; inside && dx <= radius; ++dx) {
            const int32_t half_height_here = half_height[static_cast<size_t>(dx)];
            inside = (x < dx || distance(y, x - dx) > half_height_here) &&
                     (x + dx >= width || distance(y, x + dx) > half_height_here);
          }
          core(y, x) = inside ? 1 : 0;
        }
      },
      16);
  return core;
}

Tensor<uint8_t> core_of(const Tensor<uint8_t>& mask) { return eroded(mask, rim_of(mask.dim(1))); }

}  // namespace traceflow::eval

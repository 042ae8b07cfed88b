#include "track/mask_parts.h"

#include <algorithm>

namespace traceflow {

std::vector<std::vector<int64_t>> mask_parts(const Tensor<uint8_t>& mask) {
  const int64_t height = mask.dim(0), width = mask.dim(1);
  std::vector<std::vector<int64_t>> parts;
  Tensor<uint8_t> visited({height, width});
  for (int64_t start = 0; start < mask.size(); ++start) {
    if (mask[start] == 0 || visited[start] != 0) continue;
    std::vector<int64_t>& part = parts.emplace_back(1, start);
    visited[start] = 1;
    for (size_t k = 0; k < part.size(); ++k) {
      const int64_t row = part[k] / width, column = part[k] % width;
      for (int64_t y = std::max<int64_t>(0, row - 1); y <= std::min(height - 1, row + 1); ++y) {
        for (int64_t x = std::max<int64_t>(0, column - 1); x <= std::min(width - 1, column + 1); ++x) {
          const int64_t at = y * width + x;
          if (mask[at] == 0 || visited[at] != 0) continue;
          visited[at] = 1;
          part.push_back(at);
        }
      }
    }
  }
  return parts;
}

}  // namespace traceflow

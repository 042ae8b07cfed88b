#include "capture/extent.h"

#include <algorithm>

namespace traceflow {

double camera_extent(const std::vector<Vec3<double>>& positions) {
  Vec3<double> mean(0);
  for (const Vec3<double>& position : positions) mean += position / static_cast<double>(positions.size());
  double farthest = 0;
  for (const Vec3<double>& position : positions) farthest = std::max(farthest, length(position - mean));
  return 1.1 * farthest;
}

}  // namespace traceflow

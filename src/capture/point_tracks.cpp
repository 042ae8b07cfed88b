#include "capture/point_tracks.h"

#include <cmath>

#include "capture/view_source.h"

namespace traceflow {

PointTracks tracks_of_rows(const Tensor<float>& stored, const std::vector<TrackRow>& rows) {
  const auto views = static_cast<int64_t>(rows.size());
  const int64_t points = stored.dim(1);
  PointTracks tracks{Tensor<float>({views, points, 2}), Tensor<uint8_t>({views, points})};
  for (int64_t v = 0; v < views; ++v) {
    const auto& [row, source] = rows[static_cast<size_t>(v)];
    for (int64_t n = 0; row >= 0 && n < points; ++n) {
      const float* const point = &stored(row, n, 0);
      const auto is_share = [](float x) { return x >= 0 && x <= 1; };
      if (!(point[2] >= 0.5F) || !is_share(point[0]) || !is_share(point[1])) continue;
      const Lens& lens = source->lens;
      const Vec2<double> at = lens.ideal_from_pixel({point[0] * lens.width, point[1] * lens.height});
      if (!std::isfinite(at.x) || !std::isfinite(at.y)) continue;
      tracks.direction(v, n, 0) = static_cast<float>(at.x);
      tracks.direction(v, n, 1) = static_cast<float>(at.y);
      tracks.seen(v, n) = 1;
    }
  }
  return tracks;
}

}  // namespace traceflow

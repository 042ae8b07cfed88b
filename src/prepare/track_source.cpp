#include "prepare/track_source.h"

#include <cmath>

#include "base/error.h"

namespace traceflow::prepare {

TrackSource::TrackSource(const std::filesystem::path& path)
    : tracks_(read_npz(path, "tracks")), visibility_(read_npz(path, "visibility")) {
  const Shape shape = tracks_.shape();
  const bool is_batch = shape.rank() == 4 && shape[0] == 1;
  const int first = is_batch ? 1 : 0;
  if ((shape.rank() != 3 && !is_batch) || shape[first + 2] != 2 || shape.elements() == 0) {
    throw InputError(path.string(), "tracks", shape.to_string(), "T×N×2, times before points",
                     "transpose the array if points come first");
  }
  times_ = shape[first];
  points_ = shape[first + 1];
  if (visibility_.size() != times_ * points_) {
    throw InputError(path.string(), "visibility", visibility_.shape().to_string(),
                     Shape{times_, points_}.to_string() + ", as tracks has times and points");
  }
}

Tensor<float> TrackSource::rows(const std::vector<std::string>& ids,
                                const std::map<std::string, int64_t>& matched, double width,
                                double height) const {
  Tensor<float> rows({static_cast<int64_t>(ids.size()), points_, 3});
  for (size_t i = 0; i < ids.size(); ++i) {
    const auto time = matched.find(ids[i]);
    if (time == matched.end()) continue;
    for (int64_t n = 0; n < points_; ++n) {
      const int64_t from = time->second * points_ + n;
      const double x = tracks_[2 * from], y = tracks_[2 * from + 1];
      if (!(visibility_[from] >= 0.5F) || !std::isfinite(x) || !std::isfinite(y)) continue;
      float* const to = rows.row(static_cast<int64_t>(i)) + 3 * n;
      to[0] = static_cast<float>((x + 0.5) / width);
      to[1] = static_cast<float>((y + 0.5) / height);
      to[2] = 1;
    }
  }
  return rows;
}

}  // namespace traceflow::prepare

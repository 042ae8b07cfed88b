#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/tensor.h"
#include "files/npy.h"

namespace traceflow::prepare {

// Points tracked through a video by another program: an .npz with `tracks` (T×N×2, pixels, the first pixel's
// centre at 0, as from CoTracker) and `visibility` (T×N). Both may have a leading batch dimension of one.
class TrackSource {
 public:
  // Throws InputError.
  explicit TrackSource(const std::filesystem::path& path);

  int64_t times() const { return times_; }
  int64_t points() const { return points_; }
  // tracks.npy of views with these ids (docs/captures.md): fractions of the image's width and height, and
  // whether a point is visible. matched: the time index of each id; a view without one sees no point. width,
  // height: of the tracked images.
  Tensor<float> rows(const std::vector<std::string>& ids, const std::map<std::string, int64_t>& matched,
                     double width, double height) const;

 private:
  Tensor<float> tracks_, visibility_;
  int64_t times_ = 0, points_ = 0;
};

}  // namespace traceflow::prepare

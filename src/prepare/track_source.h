#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/tensor.h"
#include "files/npy.h"

namespace traceflow::prepare {

// Points as a program tracked them through a film: an .npz with `tracks` (T×N×2, pixels, the centre of the
// first at 0, as CoTracker has them) and `visibility` (T×N), either with a batch of one before.
class TrackSource {
 public:
  // Throws InputError.
  explicit TrackSource(const std::filesystem::path& path);

  int64_t times() const { return times_; }
  int64_t points() const { return points_; }
  // tracks.npy of views with these ids (docs/captures.md): shares of a picture's sides, and whether a point
  // is seen. matched: which time belongs to an id; a view without one sees nothing. width, height: of the
  // pictures that were tracked.
  Tensor<float> rows(const std::vector<std::string>& ids, const std::map<std::string, int64_t>& matched,
                     double width, double height) const;

 private:
  Tensor<float> tracks_, visibility_;
  int64_t times_ = 0, points_ = 0;
};

}  // namespace traceflow::prepare

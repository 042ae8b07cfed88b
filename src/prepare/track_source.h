#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/tensor.h"
#include "files/npy.h"

namespace traceflow::prepare {

// Points tracked through a video by another program: an .npz with `tracks` in pixels and, in the same order,
// - `visibility`, as from CoTracker: T×N×2 and T×N, the first pixel's centre at 0; or
// - `visibles`, or the inverse `occluded` or `occlusion`, as from TAPIR: N×T×2 and N×T, the first pixel's
//   corner at 0.
// All may have a leading batch dimension of one.
class TrackSource {
 public:
  // fits: whether the capture has so many views. Where only the other order fits, it is taken. Throws
  // InputError.
  TrackSource(const std::filesystem::path& path, const std::function<bool(int64_t count)>& fits);

  int64_t times() const { return times_; }
  int64_t points() const { return points_; }
  // What was assumed of the arrays.
  const std::string& assumed() const { return assumed_; }
  // tracks.npy of views with these ids (docs/captures.md): fractions of the image's width and height, and
  // whether a point is visible. matched: the time index of each id; a view without one sees no point. width,
  // height: of the tracked images.
  Tensor<float> rows(const std::vector<std::string>& ids, const std::map<std::string, int64_t>& matched,
                     double width, double height) const;

 private:
  Tensor<float> tracks_, visibility_;
  int64_t times_ = 0, points_ = 0;
  bool is_points_first_ = false;
  bool is_occlusion_ = false;       // visibility_ tells what is hidden
  float threshold_ = 0.5F;          // of visibility_
  double first_pixels_centre_ = 0;  // its coordinate in tracks_
  std::string assumed_;
};

}  // namespace traceflow::prepare

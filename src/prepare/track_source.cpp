#include "prepare/track_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/error.h"

namespace traceflow::prepare {

namespace {

// An array that says where points are visible, and what its name says of the others.
struct VisibilityName {
  const char* name;
  bool is_of_tapir, is_occlusion;
};
constexpr std::array<VisibilityName, 4> visibility_names = {{{"visibility", false, false},
                                                             {"visibles", true, false},
                                                             {"occluded", true, true},
                                                             {"occlusion", true, true}}};

const VisibilityName& visibility_in(const std::filesystem::path& path) {
  const std::vector<std::string> names = names_in_npz(path);
  for (const VisibilityName& known : visibility_names) {
    if (std::ranges::find(names, known.name) != names.end()) return known;
  }
  throw InputError(path.string(), "", fmt::format("arrays {}", fmt::join(names, ", ")),
                   "tracks with visibility (CoTracker), visibles or occluded (TAPIR)",
                   "save both in one .npz file");
}

// Without dimensions of one before the first `rank` others, or after them.
std::vector<int64_t> without_batch(const Shape& shape, int rank) {
  std::vector<int64_t> sides;
  sides.reserve(static_cast<size_t>(shape.rank()));
  for (int i = 0; i < shape.rank(); ++i) sides.push_back(shape[i]);
  if (static_cast<int>(sides.size()) > rank && sides.front() == 1) sides.erase(sides.begin());
  if (static_cast<int>(sides.size()) > rank && sides.back() == 1) sides.pop_back();
  return sides;
}

}  // namespace

TrackSource::TrackSource(const std::filesystem::path& path, const std::function<bool(int64_t count)>& fits) {
  tracks_ = read_npz(path, "tracks");
  const VisibilityName& found = visibility_in(path);
  visibility_ = read_npz(path, found.name);
  const Shape shape = tracks_.shape();
  const std::vector<int64_t> sides = without_batch(shape, 3);
  if (sides.size() != 3 || sides[2] != 2 || shape.elements() == 0) {
    throw InputError(path.string(), "tracks", shape.to_string(),
                     found.is_of_tapir ? "N×T×2: points, times, x and y" : "T×N×2: times, points, x and y");
  }
  if (without_batch(visibility_.shape(), 2) != std::vector{sides[0], sides[1]}) {
    throw InputError(path.string(), found.name, visibility_.shape().to_string(),
                     Shape{sides[0], sides[1]}.to_string() + ", as tracks has");
  }
  is_points_first_ = found.is_of_tapir;
  const int64_t times = sides[is_points_first_ ? 1 : 0], other = sides[is_points_first_ ? 0 : 1];
  if (!fits(times) && fits(other)) is_points_first_ = !is_points_first_;
  times_ = sides[is_points_first_ ? 1 : 0];
  points_ = sides[is_points_first_ ? 0 : 1];

  is_occlusion_ = found.is_occlusion;
  // TAPIR's networks give logarithms of odds, of which 0 is one half.
  const bool is_logits =
      is_occlusion_ && std::ranges::any_of(visibility_.values(), [](float v) { return v < 0 || v > 1; });
  if (is_logits) threshold_ = 0;
  first_pixels_centre_ = found.is_of_tapir ? 0.5 : 0;
  assumed_ = fmt::format("{}{}: {} first, pixels from the {} of the first", found.name,
                         is_logits ? " as logits" : "", is_points_first_ ? "points" : "times",
                         found.is_of_tapir ? "corner" : "centre");
}

Tensor<float> TrackSource::rows(const std::vector<std::string>& ids,
                                const std::map<std::string, int64_t>& matched, double width,
                                double height) const {
  Tensor<float> rows({static_cast<int64_t>(ids.size()), points_, 3});
  const auto is_visible = [&](float value) {
    return is_occlusion_ ? value < threshold_ : value >= threshold_;
  };
  for (size_t i = 0; i < ids.size(); ++i) {
    const auto time = matched.find(ids[i]);
    if (time == matched.end()) continue;
    for (int64_t n = 0; n < points_; ++n) {
      const int64_t from = is_points_first_ ? n * times_ + time->second : time->second * points_ + n;
      const double x = tracks_[2 * from], y = tracks_[2 * from + 1];
      if (!is_visible(visibility_[from]) || !std::isfinite(x) || !std::isfinite(y)) continue;
      float* const to = rows.row(static_cast<int64_t>(i)) + 3 * n;
      to[0] = static_cast<float>((x + 0.5 - first_pixels_centre_) / width);
      to[1] = static_cast<float>((y + 0.5 - first_pixels_centre_) / height);
      to[2] = 1;
    }
  }
  return rows;
}

}  // namespace traceflow::prepare

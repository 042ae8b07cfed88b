#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "math/types.h"
#include "prepare/motion/track.h"

// How the still part of a scene goes from one picture into another.
namespace traceflow::prepare {

// A map of the plane (a turning camera, a flat or distant scene), or lines that places lie on (a camera that
// moves through depth).
struct TwoView {
  enum class Kind { homography, fundamental };
  Kind kind = Kind::homography;
  Mat3<double> matrix{1};

  // How far a track is from obeying, in pixels: from where the homography leads, or by Sampson's first-order
  // distance from the epipolar line.
  double distance(const Track& track) const;
};

// What most tracks obey to within `tolerance` pixels, by random sampling and least squares over those that
// do: the homography where it explains nearly as many as the epipolar lines, which would explain much of what
// moves as well. Nothing where fewer than 12 tracks obey either, which does not tell.
std::optional<TwoView> fit_two_view(const std::vector<Track>& tracks, double tolerance, uint64_t seed);

// The epipolar lines between two cameras of known place: x_to^T F x_from = 0 over pixels whose first has its
// centre at (0, 0). Matrices are of the cameras' pixels from their directions.
struct PlacedCamera {
  Mat3<double> pixel_from_camera{1};
  Mat3<double> camera_from_world{1};
  Vec3<double> position{0};
};
TwoView epipolar_lines(const PlacedCamera& from, const PlacedCamera& to);

// The same two views in pixels `factor` times as large.
TwoView in_larger_pixels(const TwoView& view, double factor);

// Least squares: the unit matrix, up to sign, that fits at least 4 (8) tracks. A fundamental matrix has
// rank 2.
TwoView fit_homography(const std::vector<Track>& tracks);
TwoView fit_fundamental(const std::vector<Track>& tracks);

}  // namespace traceflow::prepare

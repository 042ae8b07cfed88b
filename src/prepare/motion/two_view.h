#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "math/types.h"
#include "prepare/motion/track.h"

// The motion of the static part of a scene from one image to another.
namespace traceflow::prepare {

// A homography (a rotating camera, or a flat or distant scene) or epipolar lines (a camera that moves through
// depth).
struct TwoView {
  enum class Kind { homography, fundamental };
  Kind kind = Kind::homography;
  Mat3<double> matrix{1};

  // The error of a track in pixels: from the homography's target, or Sampson's first-order distance from the
  // epipolar line.
  double distance(const Track& track) const;
};

// The model that most tracks fit within `tolerance` pixels, by RANSAC and least squares over the inliers. The
// homography is preferred if it explains nearly as many tracks, since epipolar lines would also explain much
// of what moves. Returns nothing if fewer than 12 tracks fit either model.
std::optional<TwoView> fit_two_view(const std::vector<Track>& tracks, double tolerance, uint64_t seed);

// The epipolar lines between two cameras with known poses: x_to^T F x_from = 0, in pixels with the centre of
// the first at (0, 0). Matrices map from camera directions to pixels.
struct PlacedCamera {
  Mat3<double> pixel_from_camera{1};
  Mat3<double> camera_from_world{1};
  Vec3<double> position{0};
};
TwoView epipolar_lines(const PlacedCamera& from, const PlacedCamera& to);

// The same motion in pixels that are `factor` times as large.
TwoView in_larger_pixels(const TwoView& view, double factor);

// Least squares: the matrix of unit norm, up to sign, that best fits at least 4 (8) tracks. A fundamental
// matrix has rank 2.
TwoView fit_homography(const std::vector<Track>& tracks);
TwoView fit_fundamental(const std::vector<Track>& tracks);

}  // namespace traceflow::prepare

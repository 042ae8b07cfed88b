#pragma once

#include <optional>
#include <vector>

#include "base/tensor.h"
#include "math/types.h"

// Finds points of one image in another, with the method of Lucas and Kanade on image pyramids.
namespace traceflow::prepare {

// A grey image at full size and repeatedly halved, down to at least 16 pixels a side.
struct Pyramid {
  std::vector<Tensor<float>> levels;  // H×W

  int64_t width() const { return levels.front().dim(1); }
  int64_t height() const { return levels.front().dim(0); }
};
Pyramid make_pyramid(Tensor<float> grey);

// In pixels; the centre of the first pixel is (0, 0).
struct Track {
  Vec2<double> from{0}, to{0};
  double difference = 0;  // between the surroundings, mean over a window, of 255
};

// The best corner in every square of `spacing` pixels, if there is one.
std::vector<Vec2<double>> find_corners(const Pyramid& picture, int spacing);

// Tracks points into another image. Drops those that leave it, whose surroundings look different there, or
// that tracking back does not return to within half a pixel.
std::vector<Track> track(const Pyramid& from, const Pyramid& to, const std::vector<Vec2<double>>& places);

// Tracks one point near `from` + `shift`, a few pixels around, on at most the two finest levels.
std::optional<Track> track_near(const Pyramid& from, const Pyramid& to, const Vec2<double>& place,
                                const Vec2<double>& shift);

}  // namespace traceflow::prepare

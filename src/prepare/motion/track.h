#pragma once

#include <optional>
#include <vector>

#include "base/tensor.h"
#include "math/types.h"

// Where the places of one picture are in another: the method of Lucas and Kanade on pyramids.
namespace traceflow::prepare {

// A grey picture at full size and at halves of it, as many as leave 16 pixels a side.
struct Pyramid {
  std::vector<Tensor<float>> levels;  // H×W

  int64_t width() const { return levels.front().dim(1); }
  int64_t height() const { return levels.front().dim(0); }
};
Pyramid make_pyramid(Tensor<float> grey);

// In pixels; the centre of the first is (0, 0).
struct Track {
  Vec2<double> from{0}, to{0};
  double difference = 0;  // of the surroundings, mean over a window, of 255
};

// In every square of `spacing` pixels the place that can best be told from its neighbours, where one can.
std::vector<Vec2<double>> find_corners(const Pyramid& picture, int spacing);

// The places found again in another picture. Left out: those that leave it, whose surroundings look different
// there, or that the way back does not lead to within half a pixel of where they were.
std::vector<Track> track(const Pyramid& from, const Pyramid& to, const std::vector<Vec2<double>>& places);

// The place found again near `from` + `shift` alone, a few pixels around: by no more than the finest two
// levels.
std::optional<Track> track_near(const Pyramid& from, const Pyramid& to, const Vec2<double>& place,
                                const Vec2<double>& shift);

}  // namespace traceflow::prepare

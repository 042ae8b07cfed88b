#pragma once

#include <vector>

#include "prepare/motion/track.h"
#include "prepare/motion/two_view.h"

namespace traceflow::prepare {

// Tracks of one picture into another, and how the still part of the scene goes there.
struct Motion {
  std::vector<Track> tracks;
  TwoView still;
};

constexpr double stillness = 1;  // pixels by which what stands still may seem to move

// From this distance on a track does not obey, in pixels: what stands still is as exact as the tracks are.
double limit_of(const Motion& motion);

// Where a pattern repeats, a track that starts from nothing may end one repetition off. Those that do not
// obey are followed again from where what stands still around them goes; what is found there counts where it
// looks as much alike and obeys.
void look_again(Motion& motion, const Pyramid& from, const Pyramid& to);

}  // namespace traceflow::prepare

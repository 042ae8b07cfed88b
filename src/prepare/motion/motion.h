#pragma once

#include <vector>

#include "prepare/motion/track.h"
#include "prepare/motion/two_view.h"

namespace traceflow::prepare {

// Tracks from one image to another, and the motion of the static part of the scene.
struct Motion {
  std::vector<Track> tracks;
  TwoView still;
};

constexpr double stillness = 1;  // apparent motion of static things, pixels

// Distance in pixels above which a track does not follow the static part. It adapts to the accuracy of the
// tracks.
double limit_of(const Motion& motion);

// Corrects tracks of repeating patterns, which may be off by one repetition. Tracks that do not follow the
// static part are tracked again from the motion of static tracks around them. The new track is used if it
// follows the static part and matches about as well.
void look_again(Motion& motion, const Pyramid& from, const Pyramid& to);

}  // namespace traceflow::prepare

#pragma once

#include <cstdint>
#include <optional>

#include "track/photo_alignment.h"

// How a round body has turned over many times, where steps from one time to the next have gone astray. Over
// few times a glaze hides it: what it mirrors hardly moves and holds the texture under it back. Over many
// times the two are far apart in the picture.
namespace traceflow {

// A turn ω, radians about world axes, to be added to that of a body at a key, where the photograph costs less
// by a tenth than where the body stands: of turns up to 0.4 about each axis that is loose the best, unless
// steps downhill lead to one that costs hardly more. None where that is nearer than 0.1. alignment: of an
// earlier time's photograph. loose: of all bodies.
std::optional<Vec3<double>> seek_turn(const Alignment& alignment, const Motion& motion, int32_t body,
                                      int64_t key, const LooseTurns& loose);

// Turns a body by ω at key `last`, and by even shares of it at the keys between `first` and `last`.
void spread_turn(int32_t body, int64_t first, int64_t last, const Vec3<double>& turn, Motion& motion);

}  // namespace traceflow

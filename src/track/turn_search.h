#pragma once

#include <cstdint>
#include <optional>

#include "track/photo_alignment.h"

// Searches for the rotation of a round body over many keys if steps from key to key went wrong. Over a few
// keys a glossy coat hides the rotation: its reflection hardly moves and holds back the texture below. Over
// many keys the two are far apart in the image.
namespace traceflow {

// A rotation ω, radians about world axes, to add to that of a body at a key. It is the best of loose
// rotations of up to 0.4 about each axis, after refinement, or the minimum reached downhill from the present
// rotation if that costs hardly more. Returns nothing unless the result costs at least a tenth less than the
// present rotation and is more than 0.1 from it. alignment: with an earlier key's photograph. loose: for all
// bodies.
std::optional<Vec3<double>> seek_turn(const Alignment& alignment, const Motion& motion, int32_t body,
                                      int64_t key, const LooseTurns& loose);

// Rotates a body by ω at key `last`, and by proportional parts of ω at the keys between `first` and `last`.
void spread_turn(int32_t body, int64_t first, int64_t last, const Vec3<double>& turn, Motion& motion);

}  // namespace traceflow

#pragma once

#include "capture/synth/ray.h"

namespace traceflow::synth {

// patches: irregular cells in space, each with its own colour, so that all places of a surface can be told
// apart.
enum class Pattern { plain, checker, stripes, bricks, patches };

// Two colours in a pattern of `frequency` cells per unit of uv. `grain` darkens by up to that fraction with
// smooth noise, so that no two places look alike. Cells of patches fill space, `frequency.x` of them per
// metre of the body at rest; each colour channel is between those of the two colours, and the grain is
// smaller cells, `grain_frequency` per metre.
struct Texture {
  Pattern pattern = Pattern::plain;
  Vector first{0.5};
  Vector second{0.5};
  Vec2<double> frequency{1};
  double grain = 0;
  double grain_frequency = 12;
};

// rest: the same point in the body at rest, metres. Patches depend on it, the other patterns on uv.
Vector colour_at(const Texture& texture, const Vec2<double>& uv, const Vector& rest = Vector(0));

}  // namespace traceflow::synth

#pragma once

#include "eval/lpips.h"

// What comes before the network's first layer, shared by the fast path and the reference.
namespace traceflow::lpips {

// Added to the length that a pixel's features are divided by.
inline constexpr double length_epsilon = 1e-10;

// One value in [0, 1] of channel c, as the first convolution sees it: LPIPS's own shift and scale, which are
// the usual ImageNet statistics restated for [−1, 1].
template <class T>
T scale_channel(T value, int64_t c, Input input) {
  constexpr double shift[] = {-.030, -.088, -.188};
  constexpr double scale[] = {.458, .448, .450};
  const T x = input == Input::defined ? T(2) * value - T(1) : value;
  return (x - T(shift[c])) / T(scale[c]);
}

}  // namespace traceflow::lpips

#pragma once

#include "ops/lpips/lpips.h"

// What comes before the network's first layer, shared by the fast path and the reference.
namespace traceflow::lpips {

// Added to the length that a pixel's features are divided by.
inline constexpr double length_epsilon = 1e-10;

// LPIPS's own shift and scale of the three channels: the usual ImageNet statistics restated for [−1, 1].
inline constexpr double channel_shift[] = {-.030, -.088, -.188};
inline constexpr double channel_scale[] = {.458, .448, .450};

// One value in [0, 1] of channel c, as the first convolution sees it.
template <class T>
T scale_channel(T value, int64_t c, Input input) {
  const T x = input == Input::defined ? T(2) * value - T(1) : value;
  return (x - T(channel_shift[c])) / T(channel_scale[c]);
}

// Its derivative by the value.
inline double scale_channel_slope(int64_t c, Input input) {
  return (input == Input::defined ? 2 : 1) / channel_scale[c];
}

}  // namespace traceflow::lpips

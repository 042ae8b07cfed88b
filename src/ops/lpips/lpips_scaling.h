#pragma once

#include "base/device.h"
#include "ops/lpips/lpips.h"

// The scaling before the network's first layer, shared by the fast paths and the reference.
namespace traceflow::lpips {

// LPIPS's own shift and scale of the three channels: the usual ImageNet statistics, converted to [−1, 1].
TRACEFLOW_HD constexpr double channel_shift(int64_t c) { return c == 0 ? -.030 : c == 1 ? -.088 : -.188; }
TRACEFLOW_HD constexpr double channel_scale(int64_t c) { return c == 0 ? .458 : c == 1 ? .448 : .450; }

// One value in [0, 1] of channel c, scaled for the first convolution.
template <class T>
TRACEFLOW_HD T scale_channel(T value, int64_t c, Input input) {
  const T x = input == Input::defined ? T(2) * value - T(1) : value;
  return (x - T(channel_shift(c))) / T(channel_scale(c));
}

// Its derivative by the value.
TRACEFLOW_HD inline double scale_channel_slope(int64_t c, Input input) {
  return (input == Input::defined ? 2 : 1) / channel_scale(c);
}

}  // namespace traceflow::lpips

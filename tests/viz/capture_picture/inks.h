#pragma once

#include "viz/capture_picture/palette.h"

namespace traceflow::viz {

inline bool is(const Tensor<uint8_t>& picture, int64_t y, int64_t x, const Ink& ink) {
  const uint8_t* p = &picture(y, x, 0);
  return p[0] == ink.red && p[1] == ink.green && p[2] == ink.blue;
}

}  // namespace traceflow::viz

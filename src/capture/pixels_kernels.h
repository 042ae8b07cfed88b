#pragma once

#include <cmath>
#include <cstdint>

#include "math/types.h"

namespace traceflow {

struct WidenColour {
  const uint8_t* from;
  float* to;
  TRACEFLOW_HD void operator()(int64_t i) const { to[i] = static_cast<float>(from[i]) / 255.0F; }
};

struct TakeUnknown {
  const uint8_t* known;
  const float* rendered;
  float* colour;
  TRACEFLOW_HD void operator()(int64_t pixel) const {
    if (known[pixel] == 0) store3(colour + 3 * pixel, load3<float>(rendered + 3 * pixel));
  }
};

struct LeaveUnknown {
  const uint8_t* known;
  float* gradient;
  TRACEFLOW_HD void operator()(int64_t pixel) const {
    if (known[pixel] == 0) store3(gradient + 3 * pixel, Vec3<float>(0));
  }
};

struct WidenNormal {
  const int16_t* from;
  const uint8_t* turned;  // the mask, or null if no normal is turned
  Mat3<float> turn;
  float* to;
  TRACEFLOW_HD void operator()(int64_t pixel) const {
    Vec3<float> n = load3<float>(from + 3 * pixel);
    const float length2 = dot(n, n);
    n = length2 > 0 ? n / std::sqrt(length2) : Vec3<float>(0);
    store3(to + 3 * pixel, turned != nullptr && turned[pixel] != 0 ? turn * n : n);
  }
};

}  // namespace traceflow

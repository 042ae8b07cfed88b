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

struct WidenNormal {
  const int16_t* from;
  float* to;
  TRACEFLOW_HD void operator()(int64_t pixel) const {
    const Vec3<float> n = load3<float>(from + 3 * pixel);
    const float length2 = dot(n, n);
    store3(to + 3 * pixel, length2 > 0 ? n / std::sqrt(length2) : Vec3<float>(0));
  }
};

}  // namespace traceflow

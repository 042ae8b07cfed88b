#pragma once

#include <cstdint>

#include "base/device.h"

namespace traceflow {

// Converts one number in [0,1] to or from 8 bits, rounding to nearest and clamping (method §8). The level
// does not depend on whether the compiler fuses the product with the sum: all floats were tested.
TRACEFLOW_HD inline uint8_t to_8bit(float v) {
  const float shifted = v * 255.0F + 0.5F;
  // A NaN fails both comparisons and becomes black.
  return v >= 1.0F ? uint8_t{255} : v > 0.0F ? static_cast<uint8_t>(shifted) : uint8_t{0};
}
TRACEFLOW_HD inline float from_8bit(uint8_t v) { return static_cast<float>(v) / 255.0F; }

}  // namespace traceflow

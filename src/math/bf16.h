#pragma once

#include <cstdint>
#include <cstring>

#include "base/device.h"

// bf16, the upper 16 bits of a float, as it is stored; and functions that let a step be written once for bf16
// and fp32.
namespace traceflow {

struct Bf16 {
  uint16_t bits;
};

TRACEFLOW_HD inline float to_float(float v) { return v; }
TRACEFLOW_HD inline float to_float(Bf16 v) {
  const uint32_t bits = uint32_t{v.bits} << 16;
  float result = 0;
  memcpy(&result, &bits, sizeof(result));
  return result;
}

TRACEFLOW_HD inline void store(float v, float& to) { to = v; }
// Rounds to nearest, ties to even; a NaN stays NaN.
TRACEFLOW_HD inline void store(float v, Bf16& to) {
  uint32_t bits = 0;
  memcpy(&bits, &v, sizeof(v));
  const uint32_t rounded = (bits + 0x7FFFU + (bits >> 16 & 1U)) >> 16;
  to.bits = static_cast<uint16_t>(v == v ? rounded : 0x7FC0U);
}

// Rounds to type T.
template <class T>
TRACEFLOW_HD T rounded_to(float v) {
  T to;
  store(v, to);
  return to;
}

}  // namespace traceflow

#pragma once

#include <cmath>

#include "base/device.h"

// The positional encoding that a residual field sees (method §1.2).
namespace traceflow {

// Numbers in the encoding of a point with the given number of coordinates.
TRACEFLOW_HD constexpr int encoding_size(int coordinates, int octaves) {
  return coordinates * (1 + 2 * octaves);
}

// γ(x) = (x, sin 2⁰x, cos 2⁰x, …, sin 2^{L-1}x, cos 2^{L-1}x), each for all coordinates; fills encoding_size
// numbers. 2^k x is exact in any binary floating-point type, so the argument carries no error of its own.
template <class T>
TRACEFLOW_HD void positional_encoding(const T* x, int coordinates, int octaves, T* encoding) {
  for (int i = 0; i < coordinates; ++i) encoding[i] = x[i];
  T* out = encoding + coordinates;
  T frequency = T(1);
  for (int octave = 0; octave < octaves; ++octave, out += 2 * coordinates, frequency *= T(2)) {
    for (int i = 0; i < coordinates; ++i) {
      out[i] = std::sin(frequency * x[i]);
      out[coordinates + i] = std::cos(frequency * x[i]);
    }
  }
}

}  // namespace traceflow

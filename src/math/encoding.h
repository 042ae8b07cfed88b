#pragma once

#include <cmath>

#include "base/device.h"

// The positional encoding of a residual field (method §1.2).
namespace traceflow {

// The length of the encoding of a point with `coordinates` coordinates.
TRACEFLOW_HD constexpr int encoding_size(int coordinates, int octaves) {
  return coordinates * (1 + 2 * octaves);
}

// γ(x) = (x, sin 2⁰x, cos 2⁰x, …, sin 2^{L-1}x, cos 2^{L-1}x), each for all coordinates; writes encoding_size
// numbers. 2^k x is exact in binary floating point, so the argument has no error of its own.
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

// An angle in turns, x/2π = high + low. Multiplication by powers of two is exact for both, so removing whole
// turns from the high part is exact for any number of turns.
struct Turns {
  float high, low;
};
TRACEFLOW_HD inline Turns turns_of(float radians) {
  constexpr double turns_per_radian = 0.15915494309189533577;
  constexpr float high = static_cast<float>(turns_per_radian);
  constexpr float low = static_cast<float>(turns_per_radian - static_cast<double>(high));
  const float product = radians * high;
  return {product, std::fma(radians, high, -product) + radians * low};
}

// sin(2π·(frequency·turns + phase)) for a frequency that is a power of two; a phase of a quarter gives the
// cosine. Folds the angle to a quarter turn, then uses the series to θ¹¹; error under 1e-7.
TRACEFLOW_HD inline float sin_of_turns(Turns turns, float frequency, float phase) {
  const float whole = turns.high * frequency;
  const float fraction = (whole - std::rint(whole)) + (turns.low * frequency + phase);
  const float rest = fraction - std::rint(fraction);
  const float magnitude = std::abs(rest);
  const float folded = magnitude < 0.25F ? magnitude : 0.5F - magnitude;
  const float angle = std::copysign(folded, rest) * 6.28318530717958648F;
  const float square = angle * angle;
  float series = -2.50521083854417188e-8F;
  series = series * square + 2.75573192239858907e-6F;
  series = series * square - 1.98412698412698413e-4F;
  series = series * square + 8.33333333333333333e-3F;
  series = series * square - 1.66666666666666667e-1F;
  return series * square * angle + angle;
}

}  // namespace traceflow

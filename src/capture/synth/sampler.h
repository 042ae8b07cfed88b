#pragma once

#include <cmath>
#include <cstdint>

#include "math/types.h"

// Counter-based sampling: a number depends only on what it is for and not on earlier numbers, so images do
// not depend on the order in which pixels are computed.
namespace traceflow::synth {

// A bijection of 64-bit words in which every output bit depends on all input bits (splitmix64's finaliser).
constexpr uint64_t mix_bits(uint64_t z) {
  z += 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}
constexpr uint64_t combine_bits(uint64_t key, uint64_t value) { return mix_bits(key ^ mix_bits(value)); }
// Uniform in [0, 1).
constexpr double unit_from_bits(uint64_t bits) { return static_cast<double>(bits >> 11U) * 0x1.0p-53; }

// Points in the unit square for one sample of one pixel. Each successive use (the position in the pixel, the
// first light point, …) gets its own evenly distributed set over the pixel's samples: a randomly shifted R2
// sequence in random order, so that no two uses are correlated.
class Sampler {
 public:
  // key: of the pixel; sample in [0, count).
  Sampler(uint64_t key, uint32_t sample, uint32_t count) : key_(key), sample_(sample), count_(count) {}

  Vec2<double> next() {
    const uint64_t bits = combine_bits(key_, use_++);
    const auto index = static_cast<double>(shuffled(static_cast<uint32_t>(bits)));
    // 1/g and 1/g², where g is the plastic number, the two-dimensional golden ratio.
    const double x = unit_from_bits(bits) + 0.7548776662466927 * index;
    const double y = unit_from_bits(mix_bits(bits)) + 0.5698402909980532 * index;
    return {x - std::floor(x), y - std::floor(y)};
  }

 private:
  // The position of sample_ in a random order of [0, count_) (Kensler, Correlated Multi-Jittered Sampling,
  // §"permute").
  uint32_t shuffled(uint32_t order) const {
    uint32_t mask = count_ - 1;
    for (uint32_t shift = 1; shift < 32; shift *= 2) mask |= mask >> shift;
    uint32_t i = sample_;
    do {
      i ^= order;
      i *= 0xe170893d;
      i ^= order >> 16U;
      i ^= (i & mask) >> 4U;
      i ^= order >> 8U;
      i *= 0x0929eb3f;
      i ^= order >> 23U;
      i ^= (i & mask) >> 1U;
      i *= 1 | order >> 27U;
      i *= 0x6935fa69;
      i ^= (i & mask) >> 11U;
      i *= 0x74dcb303;
      i ^= (i & mask) >> 2U;
      i *= 0x9e501cc3;
      i ^= (i & mask) >> 2U;
      i *= 0xc860a3df;
      i &= mask;
      i ^= i >> 5U;
    } while (i >= count_);
    return (i + order) % count_;
  }

  uint64_t key_;
  uint64_t use_ = 0;
  uint32_t sample_;
  uint32_t count_;
};

// Maps a uniform point of the unit square to a uniform point of the unit disk.
inline Vec2<double> disk_point(const Vec2<double>& square) {
  const double radius = std::sqrt(square.x);
  const double angle = 6.283185307179586 * square.y;
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

}  // namespace traceflow::synth

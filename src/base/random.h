#pragma once

#include <array>
#include <cstdint>

namespace traceflow {

// xoshiro256**: a small generator whose whole state can be saved and restored. Same numbers on every
// platform.
class Random {
 public:
  using State = std::array<uint64_t, 4>;

  explicit Random(uint64_t seed = 0);
  uint64_t next();
  // Uniform in [0, 1).
  double uniform();
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  // Uniform in {0, …, n-1}; n > 0.
  int64_t below(int64_t n);
  // Standard normal deviate. Draws two uniforms each time and keeps neither, so that state_ is the whole
  // state.
  double normal();

  const State& state() const { return state_; }
  void set_state(const State& state) { state_ = state; }

 private:
  State state_;
};

}  // namespace traceflow

#pragma once

#include <benchmark/benchmark.h>

#include <string>

#include "base/device_memory.h"
#include "base/random.h"
#include "base/tensor.h"
#include "primitives/gemm.h"
#include "scene/field.h"
#include "scene/surfels.h"

// What the benchmarks of the CUDA device share: the size of the work, how it is timed, and what it cannot do
// without. scripts/floors makes a table of their results.
namespace traceflow::bench {

// One frame of a large scene.
inline constexpr int frame_width = 480, frame_height = 270;
inline constexpr int64_t frame_pixels = int64_t{frame_width} * frame_height;
inline constexpr int64_t main_surfels = 150000, environment_surfels = 75000;
inline constexpr int64_t sh_numbers = 48;  // of a surfel, degree 3

// Says why a benchmark is skipped where no device answers.
inline bool no_device(benchmark::State& state) {
  std::string why_not;
  if (cuda::is_ready(why_not)) return false;
  state.SkipWithError(("no CUDA device: " + why_not).c_str());
  return true;
}

// The least that one call must do: every number that it is given moves once, every number that it returns
// likewise (twice where it is added to), and its formulas are computed once. Bytes that an implementation
// keeps for itself do not count. bits: of the products' operands; the device's rate depends on them.
struct Floor {
  double bytes = 0, flops = 0;
  int bits = 32;
};

template <class... T>
double bytes(const Tensor<T>&... tensors) {
  return (0.0 + ... + (static_cast<double>(tensors.size()) * static_cast<double>(sizeof(T))));
}
inline double bytes(const Surfels& s) {
  return bytes(s.position, s.log_scale, s.rotation, s.opacity_logit, s.sh, s.tint_logit);
}
inline double bytes(const PosedSurfels& s) {
  return bytes(s.position, s.scale, s.rotation, s.opacity, s.sh, s.tint);
}
inline double bytes(const Field& field) {
  double sum = 0;
  field.for_each([&](const std::string&, const Tensor<float>& t) { sum += bytes(t); });
  return sum;
}

// The time of one call among several that follow each other on the device, as they do in an iteration: the
// host waits at the end of them. Memory is there and products are planned before.
template <class Step>
void time_on_device(benchmark::State& state, const Floor& floor, Step&& step) {
  constexpr int first_calls = 3, calls_at_once = 10;
  for (int k = 0; k < first_calls; ++k) step();
  cuda::synchronise();
  while (state.KeepRunningBatch(calls_at_once)) {
    for (int k = 0; k < calls_at_once; ++k) step();
    cuda::synchronise();
  }
  state.counters["floor_bytes"] = floor.bytes;
  state.counters["floor_flops"] = floor.flops;
  state.counters["bits"] = floor.bits;
}

// Uniform in [low, high), on the device.
inline Tensor<float> noise_on_device(const Shape& shape, double low, double high, uint64_t seed) {
  Random random(seed);
  Tensor<float> tensor(shape);
  for (float& v : tensor.values()) v = static_cast<float>(random.uniform(low, high));
  return tensor.on(Device::cuda);
}

inline Surfels surfels_on_device(int64_t count, bool has_tint, uint64_t seed) {
  return {noise_on_device({count, 3}, -1, 1, seed),
          noise_on_device({count, 2}, -5, -4, seed + 1),
          noise_on_device({count, 4}, -1, 1, seed + 2),
          noise_on_device({count}, -2, 2, seed + 3),
          noise_on_device({count, sh_numbers / 3, 3}, -0.3, 0.3, seed + 4),
          has_tint ? noise_on_device({count}, -2, 2, seed + 5) : Tensor<float>()};
}

// For BENCHMARK(...)->Apply: milliseconds by the clock.
inline void by_the_clock(benchmark::internal::Benchmark* b) {
  b->Unit(benchmark::kMillisecond)->UseRealTime();
}
inline void both_sets(benchmark::internal::Benchmark* b) {
  by_the_clock(b);
  b->ArgName("surfels")->Arg(main_surfels)->Arg(environment_surfels);
}

}  // namespace traceflow::bench

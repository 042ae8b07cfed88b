#pragma once

#include "math/spherical_harmonics.h"
#include "ops/trace/cuda/forward.h"

// Spherical harmonics of one surfel, for one thread. Included by .cu files only.
namespace traceflow::trace::cuda {

// Calls f(k, channel, number) for all coefficients of a surfel. Reads four at a time if the rows are aligned
// to that.
template <int degree, class F>
__device__ void for_each_coefficient(const float* row, F&& f) {
  constexpr int numbers = 3 * sh_coefficients(degree);
  struct Quad {
    float number[4];
  };
  if constexpr (numbers % 4 == 0) {
#pragma unroll
    for (int q = 0; q < numbers / 4; ++q) {
      const Quad quad = load_quads(reinterpret_cast<const Quad*>(row)[q]);
#pragma unroll
      for (int j = 0; j < 4; ++j) f((4 * q + j) / 3, (4 * q + j) % 3, quad.number[j]);
    }
  } else {
#pragma unroll
    for (int i = 0; i < numbers; ++i) f(i / 3, i % 3, row[i]);
  }
}

// Σ_k sh[k] basis[k] + 0.5: the colour before the clamp at zero.
template <int degree>
__device__ Vec3<float> raw_colour(const float* row, const float* basis) {
  float colour[3] = {0.5F, 0.5F, 0.5F};
  for_each_coefficient<degree>(
      row, [&](int k, int c, float number) { colour[c] = std::fma(number, basis[k], colour[c]); });
  return {colour[0], colour[1], colour[2]};
}

}  // namespace traceflow::trace::cuda

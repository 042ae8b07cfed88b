#pragma once

#include <algorithm>
#include <cstdint>

namespace traceflow::optimize {

// A run of consecutive entries of one parameter tensor, as the vector kernel takes it.
struct AdamBlock {
  float* parameter;
  const float* gradient;
  float* first;
  float* second;
  const float* rates;  // one for each entry
  int64_t count;
  float beta1, beta2, epsilon;
  float inverse_correction1, inverse_correction2;  // 1 / (1 − β^step)
};

}  // namespace traceflow::optimize

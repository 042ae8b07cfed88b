#pragma once

#include <array>
#include <cstdint>

#include "ops/optimize/adam.h"

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

namespace cuda {

// A whole parameter tensor on the device, as its kernel takes it.
struct AdamTensor {
  float* parameter;
  const float* gradient;
  float* first;
  float* second;
  int64_t count;
  float beta1, beta2, epsilon;
  float inverse_correction1, inverse_correction2;  // 1 / (1 − β^step)
  int32_t columns;
  std::array<float, most_rates> rates;  // one for each column
  LeftAlone* left_alone;
};
TRACEFLOW_WITH_CUDA void adam_step(const AdamTensor& tensor);

}  // namespace cuda

}  // namespace traceflow::optimize

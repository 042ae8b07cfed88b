#pragma once

#include <array>
#include <cstdint>

#include "ops/optimize/adam.h"
#include "primitives/multi_tensor.h"

namespace traceflow::optimize {

// A range of consecutive entries of one parameter tensor, as input of the vector kernel.
struct AdamBlock {
  float* parameter;
  const float* gradient;
  float* first;
  float* second;
  const float* rates;  // one per entry
  int64_t count;
  float beta1, beta2, epsilon;
  float inverse_correction1, inverse_correction2;  // 1 / (1 − β^step)
};

namespace cuda {

// A parameter tensor on the device.
struct AdamTensor {
  float* parameter;
  const float* gradient;
  float* first;
  float* second;
  int32_t count;
  int32_t columns, first_rate;                     // its rates, one per column, in the table's
  float inverse_correction1, inverse_correction2;  // 1 / (1 − β^step)
  int32_t first_block;                             // the first of the kernel's blocks that works on it
};

// Parameter tensors that one kernel steps: most are so small that a kernel each would take longer to launch.
// As large as a kernel's parameters may be.
struct AdamTable {
  static constexpr int most_tensors = 48, room_for_rates = 3 * most_rates;
  AdamOptions options;
  int32_t tensors = 0, rates = 0;
  LeftAlone* left_alone = nullptr;  // one per tensor
  std::array<AdamTensor, most_tensors> tensor{};
  std::array<float, room_for_rates> rate{};

  bool has_room(size_t more_rates) const {
    return tensors < most_tensors && static_cast<size_t>(rates) + more_rates <= room_for_rates;
  }
};
static_assert(sizeof(AdamTable) <= traceflow::cuda::most_parameter_bytes);
// Sets first_block of every tensor.
TRACEFLOW_WITH_CUDA void adam_step(AdamTable& table);

}  // namespace cuda

}  // namespace traceflow::optimize

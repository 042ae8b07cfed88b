#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/tensor.h"

// Adam (method §7.6), fused: one pass over parameters, gradients and both moments.
namespace traceflow::optimize {

struct AdamOptions {
  float beta1 = 0.9F;
  float beta2 = 0.999F;
  float epsilon = 1e-15F;
};

// First and second moment of one parameter tensor and the number of steps taken. New rows (new surfels) start
// with zero moments: code that resizes the parameter must resize these.
template <class T>
struct BasicAdamState {
  Tensor<T> first;
  Tensor<T> second;
  int64_t step = 0;
};
using AdamState = BasicAdamState<float>;

// A step of one parameter tensor. learning_rates: one rate for all, or one for each column of a row (the
// harmonics' first coefficient learns faster than the others), at most most_rates.
struct AdamTask {
  Tensor<float>* parameter;
  const Tensor<float>* gradient;
  AdamState* state;
  std::vector<float> learning_rates;
};
inline constexpr int most_rates = 64;

// The entries that a step skipped because their gradient is not finite: their number, and the first of them.
// All zeros mean none.
struct LeftAlone {
  int32_t count;
  int32_t inverted_first;  // largest_index minus the lowest index
  static constexpr int32_t largest_index = std::numeric_limits<int32_t>::max();
  int64_t first() const { return largest_index - inverted_first; }
};

// parameter −= rate · m̂ / (√v̂ + ε) for all tasks, whose tensors are on one device. Increments their step.
// If a gradient entry or its square is not finite, its parameter and moments are unchanged and it is
// recorded: left_alone gets one entry per task on that device, without a wait until it is read. If memory for
// that list runs out, nothing has changed.
void adam_step(std::span<const AdamTask> tasks, const AdamOptions& options, Tensor<LeftAlone>& left_alone);
// The same for one tensor. Returns the number of skipped entries, for which the host waits.
int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                  std::span<const float> learning_rates, const AdamOptions& options);
inline int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                         float learning_rate, const AdamOptions& options) {
  return adam_step(parameter, gradient, state, std::span<const float>(&learning_rate, 1), options);
}
int64_t adam_step_reference(Tensor<double>& parameter, const Tensor<double>& gradient,
                            BasicAdamState<double>& state, std::span<const double> learning_rates,
                            const AdamOptions& options);

// Log-linear from `start` to `end` over `steps`, then constant (method §7.6).
double log_linear(double start, double end, int64_t step, int64_t steps);

}  // namespace traceflow::optimize

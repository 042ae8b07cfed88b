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
// with zero moments: whoever resizes the parameter resizes these.
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

// What a step left alone, since its gradient is not finite: how many entries, and which is the first. All
// zeros mean none.
struct LeftAlone {
  int32_t count;
  int32_t inverted_first;  // largest_index less the lowest index
  static constexpr int32_t largest_index = std::numeric_limits<int32_t>::max();
  int64_t first() const { return largest_index - inverted_first; }
};

// parameter −= rate · m̂ / (√v̂ + ε) for all tasks, whose tensors are on one device. Increments their step. A
// gradient entry that is not finite, or whose square is not, leaves its parameter and moments alone and is
// noted: left_alone gets one entry a task there, for which nobody waits until it is read. Where there is no
// memory for those, nothing has changed.
void adam_step(std::span<const AdamTask> tasks, const AdamOptions& options, Tensor<LeftAlone>& left_alone);
// The same for one tensor. Returns how many entries were left alone, for which the host waits.
int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                  std::span<const float> learning_rates, const AdamOptions& options);
inline int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
                         float learning_rate, const AdamOptions& options) {
  return adam_step(parameter, gradient, state, std::span<const float>(&learning_rate, 1), options);
}
int64_t adam_step_reference(Tensor<double>& parameter, const Tensor<double>& gradient,
                            BasicAdamState<double>& state, std::span<const double> learning_rates,
                            const AdamOptions& options);

// Log-linear from `start` to `end` over `steps`, constant after (method §7.6).
double log_linear(double start, double end, int64_t step, int64_t steps);

}  // namespace traceflow::optimize

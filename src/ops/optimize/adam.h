#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "base/tensor.h"

// Adam (method §7.6), one parameter tensor at a time, fused: one pass over parameter, gradient and both
// moments.
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

// What a step left alone, since its gradient is not finite: how many entries, and which is the first. All
// zeros mean none.
struct LeftAlone {
  int32_t count;
  int32_t inverted_first;  // largest_index less the lowest index
  static constexpr int32_t largest_index = std::numeric_limits<int32_t>::max();
  int64_t first() const { return largest_index - inverted_first; }
};

// Where a step notes that: a place in a list on the parameter's device, which holds zeros there before.
// Nobody waits for it until the list is read.
struct LeftAloneSlot {
  Tensor<LeftAlone>& list;
  int64_t place;
};

// parameter −= rate · m̂ / (√v̂ + ε). Increments state.step. A gradient entry that is not finite, or whose
// square is not, leaves its parameter and moments alone and is noted. learning_rates: one rate for all, or
// one for each column of a row (the harmonics' first coefficient learns faster than the others), at most
// most_rates. Runs where the parameter is.
inline constexpr int most_rates = 64;
void adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state,
               std::span<const float> learning_rates, const AdamOptions& options, const LeftAloneSlot& slot);
// Returns how many entries were left alone, for which the host waits.
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

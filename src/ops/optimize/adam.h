#pragma once

#include <cstdint>

#include "base/tensor.h"

// Adam (method §7.6), one parameter tensor at a time, fused: one pass over parameter, gradient and both moments.
namespace traceflow::optimize {

struct AdamOptions {
  float beta1 = 0.9F;
  float beta2 = 0.999F;
  float epsilon = 1e-15F;
};

// First and second moment of one parameter tensor and the number of steps taken. New rows (new surfels) start with zero
// moments: whoever resizes the parameter resizes these.
template <class T>
struct BasicAdamState {
  Tensor<T> first;
  Tensor<T> second;
  int64_t step = 0;
};
using AdamState = BasicAdamState<float>;

// parameter −= rate · m̂ / (√v̂ + ε). Increments state.step. A gradient entry that is not finite leaves its parameter and
// moments alone and is counted; returns that count.
int64_t adam_step(Tensor<float>& parameter, const Tensor<float>& gradient, AdamState& state, float learning_rate,
                  const AdamOptions& options);
int64_t adam_step_reference(Tensor<double>& parameter, const Tensor<double>& gradient, BasicAdamState<double>& state,
                            double learning_rate, const AdamOptions& options);

// Log-linear from `start` to `end` over `steps`, constant after (method §7.6).
double log_linear(double start, double end, int64_t step, int64_t steps);

}  // namespace traceflow::optimize

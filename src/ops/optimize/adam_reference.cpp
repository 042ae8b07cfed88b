#include <algorithm>
#include <cmath>

#include "ops/optimize/adam.h"

namespace traceflow::optimize {

int64_t adam_step_reference(Tensor<double>& parameter, const Tensor<double>& gradient,
                            BasicAdamState<double>& state, std::span<const double> learning_rates,
                            const AdamOptions& options) {
  require(gradient.size() == parameter.size() && state.first.size() == parameter.size() &&
              state.second.size() == parameter.size() && !learning_rates.empty(),
          "gradient and moments fit their parameter", parameter.shape().to_string());
  const auto beta1 = static_cast<double>(options.beta1);
  const auto beta2 = static_cast<double>(options.beta2);
  ++state.step;
  const double correction1 = 1 - std::pow(beta1, static_cast<double>(state.step));
  const double correction2 = 1 - std::pow(beta2, static_cast<double>(state.step));
  int64_t not_finite = 0;
  for (int64_t i = 0; i < parameter.size(); ++i) {
    const double g = gradient[i];
    if (!std::isfinite(g * g)) {
      ++not_finite;
      continue;
    }
    state.first[i] = beta1 * state.first[i] + (1 - beta1) * g;
    state.second[i] = beta2 * state.second[i] + (1 - beta2) * g * g;
    const double rate = learning_rates[static_cast<size_t>(i) % learning_rates.size()];
    parameter[i] -= rate * (state.first[i] / correction1) /
                    (std::sqrt(state.second[i] / correction2) + static_cast<double>(options.epsilon));
  }
  return not_finite;
}

double log_linear(double start, double end, int64_t step, int64_t steps) {
  if (steps <= 0) return end;
  const double t = std::clamp(static_cast<double>(step) / static_cast<double>(steps), 0.0, 1.0);
  return std::exp((1 - t) * std::log(start) + t * std::log(end));
}

}  // namespace traceflow::optimize

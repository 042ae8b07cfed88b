#include "train/divergence_monitor.h"

#include <algorithm>
#include <cmath>

namespace traceflow {

namespace {

// The weight of one iteration in the smoothed PSNR: about the last hundred views count.
constexpr double smoothing = 0.01;
// The mean over fewer views does not show a collapse.
constexpr int64_t settling_steps = 300;

}  // namespace

std::string DivergenceMonitor::check(const LossValues& terms, const NonFiniteGradients& gradients) {
  if (!std::isfinite(terms.total)) return "the loss is not finite";
  if (gradients.count > 0) {
    dropped_ += gradients.count;
    if (policy_ == NonFinite::stop) {
      return std::to_string(gradients.count) + " gradients are not finite, the first at " + gradients.first;
    }
  }
  if (!terms.psnr) return "";
  ++steps_;
  const double weight = std::max(smoothing, 1.0 / static_cast<double>(steps_));
  smoothed_ += weight * (*terms.psnr - smoothed_);
  if (steps_ < settling_steps) return "";
  best_ = std::max(best_, smoothed_);
  if (collapse_decibels_ > 0 && smoothed_ < best_ - static_cast<double>(collapse_decibels_)) {
    return "the mean PSNR fell from " + std::to_string(best_) + " to " + std::to_string(smoothed_) + " dB";
  }
  return "";
}

void DivergenceMonitor::expect_fall() {
  best_ = 0;
  steps_ = 0;
}

bool DivergenceMonitor::sound() const {
  return steps_ < settling_steps || collapse_decibels_ <= 0 ||
         smoothed_ > best_ - static_cast<double>(collapse_decibels_) / 2;
}

void DivergenceMonitor::set_state(const State& state) {
  smoothed_ = state.smoothed;
  best_ = state.best;
  steps_ = state.steps;
}

}  // namespace traceflow

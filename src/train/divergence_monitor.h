#pragma once

#include <string>

#include "train/objective.h"
#include "train/optimiser.h"

namespace traceflow {

// Detects divergence of a run: losses or gradients that are not finite, and a PSNR that collapses.
class DivergenceMonitor {
 public:
  DivergenceMonitor(NonFinite policy, float collapse_decibels)
      : policy_(policy), collapse_decibels_(collapse_decibels) {}

  // Call after each iteration. Returns why the run must stop, or an empty string.
  std::string check(const LossValues& terms, const NonFiniteGradients& gradients);
  // Forgets the best PSNR so far, because an opacity reset lowers the PSNR on purpose.
  void expect_fall();

  double smoothed_psnr() const { return smoothed_; }
  // Whether the run may be saved: its PSNR is not far below its best.
  bool sound() const;
  int64_t dropped() const { return dropped_; }

  struct State {
    double smoothed = 0;
    double best = 0;
    int64_t steps = 0;
  };
  State state() const { return {smoothed_, best_, steps_}; }
  void set_state(const State& state);

 private:
  NonFinite policy_;
  float collapse_decibels_;
  double smoothed_ = 0;
  double best_ = 0;
  int64_t steps_ = 0;    // since the last expected fall
  int64_t dropped_ = 0;  // gradient entries that were not finite and were not applied
};

}  // namespace traceflow

#pragma once

#include "train/options.h"

namespace traceflow {

// What a run of this size takes at most, in bytes: parameters, gradients, moments, posed copies, the fields'
// activations, the tracer's hit lists, images and the image cache. An estimate from the shapes, on the high
// side.
int64_t forecast_bytes(const TrainOptions& options, int64_t main, int64_t environment, int width, int height);

// Caps on the two sets' sizes that keep a run within its memory budget.
struct SurfelCaps {
  int64_t main = 0;
  int64_t environment = 0;
  bool lowered = false;  // the budget allows less than the options ask for
};
SurfelCaps surfel_caps(const TrainOptions& options, int width, int height);

// Bytes that a run may take: options.memory_budget, or three quarters of what the machine has free.
int64_t memory_budget_bytes(const TrainOptions& options);

}  // namespace traceflow

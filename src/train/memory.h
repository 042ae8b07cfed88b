#pragma once

#include "capture/capture.h"
#include "render/renderer.h"
#include "train/options.h"

namespace traceflow {

// Where a run trains, and on what: all that its memory depends on beside the sets' sizes.
struct MemorySetting {
  const TrainOptions& options;
  Device device;
  int64_t pixels;  // of its largest photograph
  int64_t times;   // at which it has views
};
MemorySetting memory_setting(const TrainOptions& options, Device device, const Capture& capture);

// Pixels of the largest view of both splits: a run renders them all.
int64_t largest_view(const Capture& capture);

// Bytes that the device, for the CPU the machine, can give.
int64_t available_bytes(Device device);

// Bytes that a run may take: options.memory_budget, or three quarters of what can be given.
int64_t memory_budget_bytes(const TrainOptions& options, Device device);

// What a run with sets of these sizes takes at most, in bytes on its device: parameters, gradients, moments,
// posed copies, the fields' activations, tile lists, the tracer's tree and hit lists, images and those that
// are kept. An estimate from the shapes, on the high side.
int64_t forecast_bytes(const MemorySetting& run, const KeptMemory& kept, int64_t main, int64_t environment);

// Caps on the two sets' sizes that keep a run within its memory budget.
struct SurfelCaps {
  int64_t main = 0;
  int64_t environment = 0;
  bool lowered = false;  // the budget allows less than the options ask for
};

// How a run's memory is dealt out before it starts. Throws InputError where the budget does not even hold its
// images.
struct MemoryPlan {
  int64_t budget_bytes = 0;
  int64_t forecast_bytes = 0;  // with both sets at their caps
  SurfelCaps caps;
  KeptMemory kept;
  int64_t image_bytes = 0;  // photographs kept on the device
};
MemoryPlan plan_memory(const MemorySetting& run);
// The same with given caps, within the budget or not.
MemoryPlan with_caps(MemoryPlan plan, const MemorySetting& run, const SurfelCaps& caps);

// What a run takes at most, in bytes, where no budget limits it: both sets at the options' caps, all kept
// that is worth keeping.
int64_t unlimited_forecast(const MemorySetting& run);

}  // namespace traceflow

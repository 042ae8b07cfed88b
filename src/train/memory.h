#pragma once

#include <string>

#include "capture/capture.h"
#include "render/renderer.h"
#include "train/options.h"

namespace traceflow {

// What the memory of a run depends on besides the sizes of the sets.
struct MemorySetting {
  const TrainOptions& options;
  Device device;
  int64_t pixels;  // of the largest photograph
  int64_t times;   // number of times with views
};
MemorySetting memory_setting(const TrainOptions& options, Device device, const Capture& capture);

// The pixels of the largest view of both splits; a run renders them all.
int64_t largest_view(const Capture& capture);

// The bytes available on the device; for the CPU, of the machine.
int64_t available_bytes(Device device);

// The bytes that a run may use: options.memory_budget, or three quarters of the available ones.
int64_t memory_budget_bytes(const TrainOptions& options, Device device);

// An upper bound on the bytes that a run with sets of these sizes uses on its device: parameters, gradients,
// moments, posed copies, activations of the fields, tile lists, the tracer's hierarchy and hit lists, images
// and cached images. Estimated from the shapes; rather too high than too low.
int64_t forecast_bytes(const MemorySetting& run, const KeptMemory& kept, int64_t main, int64_t environment);

// Caps on the sizes of the two sets that keep a run within its memory budget.
struct SurfelCaps {
  int64_t main = 0;
  int64_t environment = 0;
  bool lowered = false;  // below what the options ask for, because of the budget
};

// The distribution of a run's memory, made before it starts. Throws InputError when the budget is too small
// even for the images.
struct MemoryPlan {
  int64_t budget_bytes = 0;
  int64_t forecast_bytes = 0;  // with both sets at their caps
  SurfelCaps caps;
  KeptMemory kept;
  int64_t image_bytes = 0;  // photographs kept on the device
};
MemoryPlan plan_memory(const MemorySetting& run);
// The same plan with given caps, which may exceed the budget.
MemoryPlan with_caps(MemoryPlan plan, const MemorySetting& run, const SurfelCaps& caps);

// Limits the initial sizes of the two sets to the caps.
TrainOptions limited_to(const SurfelCaps& caps, TrainOptions options);

// The warning if the caps are lowered, or if a resumed run may use more than is available now; else empty.
std::string lowered_caps_warning(const SurfelCaps& caps);
std::string resumed_plan_warning(const MemoryPlan& plan, int64_t available);
// The advice after running out of memory. half_updated: the scene is, and so cannot be saved.
std::string out_of_memory_advice(bool half_updated, bool has_checkpoint);

// An upper bound on the bytes of a run without a budget: both sets at the options' caps, and everything
// cached that is worth caching.
int64_t unlimited_forecast(const MemorySetting& run);

}  // namespace traceflow

#pragma once

#include <nlohmann/json_fwd.hpp>

#include "capture/checks/inspection.h"
#include "train/options.h"

namespace traceflow::cli {

// What a run on the capture would take, bytes.
struct MemoryNeeds {
  int64_t kept_images = 0;  // decoded, of those that the cache holds
  int64_t on_cpu = 0;       // of a training at most
  int64_t on_cuda = 0;
  int64_t available = 0;  // on this machine, now
};

// Adds a finding where even the images are too many for this machine.
MemoryNeeds memory_needs(const Capture& capture, const TrainOptions& options, Inspection& inspection);

// What `traceflow inspect` prints (docs/inspect.md).
void print_report(const Capture& capture, const Inspection& found, const MemoryNeeds& memory);
nlohmann::json report_json(const Capture& capture, const Inspection& found, const MemoryNeeds& memory);

}  // namespace traceflow::cli

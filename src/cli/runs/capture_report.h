#pragma once

#include <nlohmann/json_fwd.hpp>

#include "capture/checks/inspection.h"
#include "train/options.h"

namespace traceflow::cli {

// Memory that training on the capture needs, bytes.
struct MemoryNeeds {
  int64_t kept_images = 0;  // decoded images that the cache holds
  int64_t on_cpu = 0;       // upper limit for training
  int64_t on_cuda = 0;
  int64_t available = 0;  // on this machine, at present
};

// Adds a finding if the images alone exceed this machine's memory.
MemoryNeeds memory_needs(const Capture& capture, const TrainOptions& options, Inspection& inspection);

// What `traceflow inspect` prints (docs/inspect.md).
void print_report(const Capture& capture, const Inspection& found, const MemoryNeeds& memory);
nlohmann::json report_json(const Capture& capture, const Inspection& found, const MemoryNeeds& memory);

}  // namespace traceflow::cli

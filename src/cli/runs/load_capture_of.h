#pragma once

#include "runs/loaded_scene.h"

namespace traceflow::cli {

// capture_of(), with its warning printed to standard error.
Capture load_capture_of(const TrainedRun& run, const std::filesystem::path& folder, int downscale);
Capture load_capture_of(const LoadedScene& scene, const std::filesystem::path& folder, int downscale);

}  // namespace traceflow::cli

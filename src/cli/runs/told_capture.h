#pragma once

#include "runs/loaded_scene.h"

namespace traceflow::cli {

// capture_of(), with its warning printed to standard error.
Capture told_capture(const TrainedRun& run, const std::filesystem::path& folder, int downscale);
Capture told_capture(const LoadedScene& scene, const std::filesystem::path& folder, int downscale);

}  // namespace traceflow::cli

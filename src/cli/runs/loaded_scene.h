#pragma once

#include <optional>
#include <string>

#include "cli/runs/trained_run.h"

namespace traceflow::cli {

// A scene and, when it comes from a run, what else is known of it.
struct LoadedScene {
  viz::Subject subject;
  std::optional<TrainedRun> run;
};

// A run's folder, a .ply or a folder that export wrote; a folder that is both is the run's. environment: a
// .ply's own, with which such a folder is the export's, or empty.
LoadedScene load_scene(const std::filesystem::path& path, const std::string& environment);

// The capture in `folder`; of a run the one that it was trained on, where that is empty. downscale 0: the
// run's, or the usual one. Throws InputError.
Capture capture_of(const LoadedScene& scene, const std::filesystem::path& folder, int downscale);

}  // namespace traceflow::cli

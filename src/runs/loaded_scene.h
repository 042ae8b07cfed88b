#pragma once

#include <optional>
#include <string>

#include "runs/trained_run.h"

namespace traceflow {

// A scene and, if it comes from a run, the run's other data.
struct LoadedScene {
  viz::Subject subject;
  std::optional<TrainedRun> run;
};

// Loads a run's folder, a .ply or a folder written by export. A folder that is both counts as a run.
// environment: the .ply with the reflected surfels, or empty; if given, such a folder counts as an export.
LoadedScene load_scene(const std::filesystem::path& path, const std::string& environment);

// The capture in `folder` or, if that is empty, the one that the run was trained on. downscale 0: the run's,
// or the default. `warning` as in runs/trained_run.h. Throws InputError.
Capture capture_of(const LoadedScene& scene, const std::filesystem::path& folder, int downscale,
                   std::string& warning);

}  // namespace traceflow

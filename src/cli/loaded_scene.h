#pragma once

#include <optional>
#include <string>

#include "cli/trained_run.h"

namespace traceflow::cli {

// A scene and, when it comes from a run, what else is known of it.
struct LoadedScene {
  show::Subject subject;
  std::optional<TrainedRun> run;
};

// A run's folder, a .ply or a folder that export wrote. environment: a .ply's own, or empty.
LoadedScene load_scene(const std::filesystem::path& path, const std::string& environment);

}  // namespace traceflow::cli

#include "runs/loaded_scene.h"

#include "scene/run_folder.h"

namespace traceflow {

LoadedScene load_scene(const std::filesystem::path& path, const std::string& environment) {
  if (std::filesystem::is_regular_file(path))
    return {viz::read_splat_subject(path, environment), std::nullopt};
  // If a run was exported into its own folder, the run contains more than the exported time.
  const bool is_taken_for_run = environment.empty() && RunFolder{path}.holds_a_run();
  if (!is_taken_for_run && std::filesystem::is_regular_file(path / "main.ply")) {
    return {viz::read_splat_subject(path / "main.ply", environment), std::nullopt};
  }
  if (!std::filesystem::exists(path)) {
    throw InputError(path.string(), "", "no such file or folder", "a run's folder, a .ply or an .spz");
  }
  if (!environment.empty()) {
    throw InputError("option", "environment", "a run, which has its own", "a .ply to go with");
  }
  TrainedRun run = read_run(path);
  viz::Subject subject = std::move(run.subject);
  subject.warning = run.note;
  return {std::move(subject), std::move(run)};
}

Capture capture_of(const LoadedScene& scene, const std::filesystem::path& folder, int downscale,
                   std::string& warning) {
  if (scene.run) return capture_of(*scene.run, folder, downscale, warning);
  CaptureOptions options;
  if (downscale > 0) options.downscale = downscale;
  return load_capture(folder, options);
}

}  // namespace traceflow

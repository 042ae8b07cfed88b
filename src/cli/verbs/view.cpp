#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <iostream>
#include <memory>

#include "cli/arguments/device_arguments.h"
#include "cli/arguments/server_arguments.h"
#include "cli/runs/load_capture_of.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"
#include "serve/run_view.h"
#include "viz/cameras/orbit.h"

namespace traceflow::cli {

namespace {

struct ViewArguments {
  std::string scene, environment, capture;
  int downscale = 0;
};

// The extent of a .ply that does not store one.
float extent_of(const Surfels& surfels, const serve::SceneInfo& info) {
  std::vector<viz::Shot> shots;
  for (const serve::CapturedCamera& view : info.train) shots.push_back({view.id, view.time, view.camera});
  if (shots.empty()) shots = viz::orbit_around_points(surfels.position, 16, 9, 8);
  return viz::extent_seen_from(surfels, shots);
}

serve::RunView::Shown shown_of(TrainedRun run) {
  return {std::move(run.subject), run.iterations, run.options.iterations, std::move(run.note)};
}

// The capture, if available: a run can be viewed without its photographs.
std::optional<Capture> capture_beside(const ViewArguments& a, const LoadedScene& scene) {
  if (!a.capture.empty()) return load_capture_of(scene, a.capture, a.downscale);
  if (!scene.run) return std::nullopt;
  const std::filesystem::path& folder = scene.run->capture_folder;
  if (std::filesystem::exists(folder)) return load_capture_of(scene, folder, a.downscale);
  std::cerr << folder.string()
            << " is not there: no photographs to compare with; say where they are with -d CAPTURE\n";
  return std::nullopt;
}

void view(const ViewArguments& a, const DeviceArguments& devices, const ServerArguments& where) {
  serve::RunWatch watch(RunFolder{a.scene});
  LoadedScene loaded = load_scene(a.scene, a.environment);
  Scene& scene = loaded.subject.scene;
  if (!loaded.subject.warning.empty()) std::cerr << loaded.subject.warning << std::endl;
  const std::optional<Capture> capture = capture_beside(a, loaded);
  serve::SceneInfo info = serve::make_scene_info(loaded.run ? "run" : "ply", run_name(a.scene),
                                                 capture ? &*capture : nullptr, scene.normalisation);
  if (!(scene.extent > 0)) scene.extent = extent_of(scene.main, info);

  serve::RunView::Shown shown{std::move(loaded.subject)};
  if (loaded.run) {
    shown.iteration = loaded.run->iterations;
    shown.iterations = loaded.run->options.iterations;
    shown.note = loaded.run->note;
  }
  serve::RunView view(std::move(info), std::move(shown), devices.choose());
  if (loaded.run) view.follow(std::move(watch), [&a] { return shown_of(read_run(a.scene)); });
  const auto server = where.start(view.handler());
  view.run(stop_on_signals());
}

}  // namespace

void add_view(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("view", "View a run, a .ply or an .spz in a browser");
  const auto a = std::make_shared<ViewArguments>();
  verb->add_option("SCENE", a->scene, "A run's folder, a .ply, an .spz or a folder written by export")
      ->required();
  verb->add_option("--environment", a->environment,
                   "A second .ply, with the surfels that the first one reflects");
  verb->add_option(
          "-d,--data", a->capture,
          "The capture, a folder or a zip archive, if it has moved since training or SCENE is a .ply")
      ->option_text("CAPTURE");
  verb->add_option("--downscale", a->downscale,
                   "Use the capture at 1/K of the full image size; default: the size used in training")
      ->check(CLI::Range(1, 64));
  const ServerArguments where(*verb);
  const DeviceArguments devices(*verb);
  verb->callback([a, devices, where] { view(*a, devices, where); });
}

}  // namespace traceflow::cli

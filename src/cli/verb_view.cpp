#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "cli/device_arguments.h"
#include "cli/server_arguments.h"
#include "cli/stop_signal.h"
#include "cli/trained_run.h"
#include "cli/verbs.h"
#include "serve/run_view.h"
#include "show/orbit.h"

namespace traceflow::cli {

namespace {

struct ViewArguments {
  std::string scene, environment, capture;
  int downscale = 0;
};

// What a .ply that does not tell its scene's size is taken for.
float extent_of(const Surfels& surfels, const serve::Setting& setting) {
  std::vector<show::Shot> shots;
  for (const serve::CapturedCamera& view : setting.train) shots.push_back({view.id, view.time, view.camera});
  if (shots.empty()) shots = show::orbit_around_points(surfels.position, 16, 9, 8);
  return show::extent_seen_from(surfels, shots);
}

serve::RunView::Shown shown_of(TrainedRun run, Device device) {
  run.subject.scene.move_to(device);
  return {std::move(run.subject), run.iterations, run.options.iterations};
}

// The capture, where it is still there: a run can be looked at without its photographs.
std::optional<Capture> capture_beside(const ViewArguments& a, const TrainedRun& run) {
  if (a.capture.empty() && !std::filesystem::exists(run.capture_folder)) {
    fmt::print(stderr,
               "{} is not there: no photographs to compare with; say where they are with -d CAPTURE\n",
               run.capture_folder.string());
    return std::nullopt;
  }
  return capture_of(run, a.capture, a.downscale);
}

void view_run(const ViewArguments& a, const DeviceArguments& devices, const ServerArguments& where) {
  TrainedRun run = read_run(a.scene);
  if (!run.note.empty()) fmt::print(stderr, "{}\n", run.note);
  if (!a.environment.empty())
    throw InputError("option", "environment", "a run, which has its own", "a .ply to go with");
  const std::optional<Capture> capture = capture_beside(a, run);
  const Device device = devices.choose();
  const RunFolder folder{a.scene};
  serve::Setting setting = serve::make_setting("run", run_name(a.scene), capture ? &*capture : nullptr,
                                               run.subject.scene.normalisation);
  serve::RunView view(std::move(setting), shown_of(std::move(run), device));
  view.follow(folder, [&a, device] { return shown_of(read_run(a.scene), device); });
  const auto server = where.start(view.room());
  view.run(stop_on_signals());
}

void view_ply(const std::filesystem::path& path, const ViewArguments& a, const DeviceArguments& devices,
              const ServerArguments& where) {
  serve::RunView::Shown shown{show::read_ply_subject(path, a.environment)};
  show::Subject& subject = shown.subject;
  if (!subject.warning.empty()) fmt::print(stderr, "{}\n", subject.warning);
  std::optional<Capture> capture;
  if (!a.capture.empty()) {
    CaptureOptions options;
    if (a.downscale > 0) options.downscale = a.downscale;
    capture = load_capture(a.capture, options);
  }
  serve::Setting setting = serve::make_setting("ply", path.filename().string(), capture ? &*capture : nullptr,
                                               subject.scene.normalisation);
  if (!(subject.scene.extent > 0)) subject.scene.extent = extent_of(subject.scene.main, setting);
  subject.scene.move_to(devices.choose());
  serve::RunView view(std::move(setting), std::move(shown));
  const auto server = where.start(view.room());
  view.run(stop_on_signals());
}

void view(const ViewArguments& a, const DeviceArguments& devices, const ServerArguments& where) {
  const std::filesystem::path path(a.scene);
  if (std::filesystem::is_regular_file(path)) return view_ply(path, a, devices, where);
  if (std::filesystem::is_regular_file(path / "main.ply"))
    return view_ply(path / "main.ply", a, devices, where);
  view_run(a, devices, where);
}

}  // namespace

void add_view(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("view", "Look at a run or a .ply in a browser");
  const auto a = std::make_shared<ViewArguments>();
  verb->add_option("SCENE", a->scene, "A run's folder, a 2DGS .ply, or a folder that export wrote")
      ->required();
  verb->add_option("--environment", a->environment, "Surfels that a .ply reflects, a .ply as well");
  verb->add_option("-d,--data", a->capture, "The capture's folder, where it is not where the run found it");
  verb->add_option("--downscale", a->downscale, "Another size of the capture than the run was trained at")
      ->check(CLI::Range(1, 64));
  const ServerArguments where(*verb);
  const DeviceArguments devices(*verb);
  verb->callback([a, devices, where] { view(*a, devices, where); });
}

}  // namespace traceflow::cli

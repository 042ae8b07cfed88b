#include "cli/runs/evaluation.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <ctime>
#include <iostream>

#include "base/atomic_file.h"
#include "base/clock.h"
#include "base/option_fields.h"
#include "base/version.h"
#include "cli/runs/load_capture_of.h"
#include "cli/terminal/count_progress.h"
#include "scene/run_folder.h"
#include "scene/viewpoint.h"
#include "train/camera_alignment.h"
#include "train/targets.h"
#include "viz/cameras/camera_file.h"

namespace traceflow::cli {

namespace {

std::optional<lpips::Network> read_lpips(const std::string& path) {
  if (!path.empty()) return lpips::network_of(lpips::read_weights(path));
  std::cerr
      << "LPIPS is null: it needs weights. scripts/export_lpips.py writes them, --lpips FILE reads them "
         "(docs/eval.md)\n";
  return std::nullopt;
}

// The options beside those of the most similar preset. A run does not store the preset that it started from.
std::vector<eval::Setting> settings_of(const TrainOptions& options) {
  TrainOptions copy = options;
  const std::vector<OptionField> fields = option_fields(copy);
  std::vector<eval::Setting> nearest;
  size_t fewest = fields.size() + 1;
  for (const char* name : {"paper", "cpu", "demo"}) {
    TrainOptions usual = preset(name);
    const std::vector<OptionField> usual_fields = option_fields(usual);
    std::vector<eval::Setting> settings;
    size_t changed = 0;
    for (size_t i = 0; i < fields.size(); ++i) {
      settings.push_back({fields[i].path, option_text(fields[i].get()), option_text(usual_fields[i].get()),
                          fields[i].unit, fields[i].full_help()});
      changed += settings.back().value != settings.back().usual ? 1 : 0;
    }
    if (changed >= fewest) continue;
    fewest = changed;
    nearest = std::move(settings);
  }
  return nearest;
}

}  // namespace

void add_evaluation_arguments(CLI::App& verb, EvaluationArguments& a) {
  verb.add_option("RUN", a.run, "The run's folder")->required();
  verb.add_option("--split", a.split, "Views to measure: test or train")
      ->check(CLI::IsMember({"test", "train"}))
      ->capture_default_str();
  verb.add_option("-d,--data", a.capture,
                  "The capture, a folder or a zip archive, if it has moved since training")
      ->option_text("CAPTURE");
  verb.add_option("--downscale", a.downscale,
                  "Measure at 1/K of the full image size; default: the size used in training")
      ->check(CLI::Range(1, 64));
  verb.add_flag("--align-cameras", a.align_cameras,
                "Also measure with cameras aligned to the photographs; always on for held-out views of a run "
                "that refined its cameras");
  verb.add_option("--lpips", a.lpips, "Weights of the LPIPS network, as written by scripts/export_lpips.py")
      ->envname("TRACEFLOW_LPIPS");
}

Evaluation::Evaluation(const EvaluationArguments& a, const DeviceArguments& devices)
    : folder_(a.run),
      run_(read_run(a.run)),
      capture_(load_capture_of(run_, a.capture, a.downscale)),
      views_(&views_of(capture_, a.split)),
      aligns_(a.align_cameras || (a.split == "test" && !run_.cameras.empty())),
      pictures_(views_->size()) {
  if (!run_.note.empty()) std::cerr << run_.note << std::endl;
  for (const View& view : *views_) viz::check_name(capture_.folder.string(), "view id", view.id);
  network_ = read_lpips(a.lpips);
  device_ = devices.choose();
  run_.subject.scene.move_to(device_);
  if (network_) network_ = network_->on(device_);
  report_.capture = capture_.name;
  report_.split = a.split;
  report_.downscale = a.downscale > 0 ? a.downscale : run_.options.capture.downscale;
  report_.device = name_of(device_);
  report_.views_as_trained = has_views_of(run_, capture_);
  report_.iterations = run_.iterations;
  report_.train_seconds = run_.train_seconds;
}

void Evaluation::measure(const eval::ViewListener& listener) {
  eval::evaluate(
      run_.subject, capture_, *views_, network_ ? &*network_ : nullptr,
      [&](const View& view, const ViewImages& images, const Frame& frame) {
        if (pictures_.wants(static_cast<size_t>(&view - views_->data())))
          pictures_.add(view.id, images.colour, frame, images.known);
        if (listener) listener(view, images, frame);
      },
      report_);
  if (!aligns_) return;
  eval::Report aligned;
  eval::evaluate(run_.subject, capture_, aligned_views(), network_ ? &*network_ : nullptr, nullptr, aligned);
  report_.aligned = eval::mean_of(aligned);
}

std::vector<View> Evaluation::aligned_views() {
  const viz::Subject& subject = run_.subject;
  const SceneNormalisation &of_capture = capture_.normalisation, &of_scene = subject.scene.normalisation;
  Renderer renderer(subject.render);
  Targets targets(device_, 0);
  std::vector<View> views = *views_;
  CountProgress progress = CountProgress::for_stderr();
  const Clock::time_point start = Clock::now();
  for (size_t i = 0; i < views.size(); ++i) {
    FrameRequest request = subject.request;
    request.camera = renormalised(views[i].camera, of_capture, of_scene);
    request.time = views[i].time;
    ViewImages& photograph = targets.of(capture_, views[i], false);
    views[i].camera =
        renormalised(aligned_camera(renderer, subject.scene, request, photograph, run_.options.loss),
                     of_scene, of_capture);
    progress.show({"align", "cameras", static_cast<int64_t>(i) + 1, static_cast<int64_t>(views.size())},
                  seconds_since(start));
  }
  progress.finish();
  return views;
}

void Evaluation::write_page(const std::filesystem::path& path) {
  eval::ReportPage page;
  page.version = version();
  page.made = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  page.run = run_name(folder_);
  page.machine = this_machine(device_);
  page.report = report_;
  page.settings = settings_of(run_.options);
  const std::vector<LoggedEvent> events = read_log(RunFolder{folder_}.log());
  page.phases = phases_of(events);
  page.events = lines_of(thinned(events));
  page.pictures = pictures_.take();
  write_atomically(path, eval::report_page(page));
}

}  // namespace traceflow::cli

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>

#include "base/clock.h"
#include "cli/arguments/device_arguments.h"
#include "cli/runs/trained_run.h"
#include "cli/terminal/count_progress.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"
#include "scene/viewpoint.h"
#include "viz/bake.h"

namespace traceflow::cli {

namespace {

constexpr int64_t most_times = 10000;

struct ExportArguments {
  std::string run, output, format = "2dgs", times, capture;
  float time = 0;
  bool undeformed = false, bake = false;
};

viz::SplatFormat format_of(const std::string& name) {
  const auto names = enum_names(viz::SplatFormat());
  return static_cast<viz::SplatFormat>(std::ranges::find(names, name) - names.begin());
}

// What the files lack, on standard error.
void print_losses(const viz::Subject& subject, viz::SplatFormat format, bool bake) {
  if (!subject.request.specular || subject.scene.specular == Specular::none || bake) return;
  if (format != viz::SplatFormat::surfel_ply) {
    std::cerr << "the files are without reflections, which only 2dgs has: --bake adds them as harmonics\n";
  } else if (subject.scene.specular == Specular::environment_map) {
    std::cerr
        << "this run's reflections are a cube map, which a .ply cannot hold: main.ply alone is written\n";
  } else if (subject.scene.environment_map) {
    std::cerr << "the cube map behind this run's environment is left out: a .ply cannot hold one\n";
  }
}

// The run's capture, read when it is first needed.
class RunCapture {
 public:
  RunCapture(const TrainedRun& run, const ExportArguments& a) : run_(run), a_(a) {}
  const Capture& get() {
    if (!capture_) capture_ = capture_of(run_, a_.capture, 0);
    return *capture_;
  }
  std::vector<Camera<float>> training_cameras() {
    std::vector<Camera<float>> cameras;
    for (const View& view : views_of(get(), "train"))
      cameras.push_back(renormalised(view.camera, get().normalisation, run_.subject.scene.normalisation));
    return cameras;
  }

 private:
  const TrainedRun& run_;
  const ExportArguments& a_;
  std::optional<Capture> capture_;
};

// Empty: only --time.
std::vector<float> times_in(const ExportArguments& a, RunCapture& capture) {
  if (a.times.empty()) return {};
  if (a.times == "all") return times_of(capture.get());
  int64_t count = 0;
  const auto [end, error] = std::from_chars(a.times.data(), a.times.data() + a.times.size(), count);
  if (error != std::errc() || end != a.times.data() + a.times.size() || count < 2 || count > most_times)
    throw InputError("option", "times", a.times, fmt::format("all, or a number from 2 to {}", most_times));
  std::vector<float> times;
  for (int64_t i = 0; i < count; ++i) times.push_back(static_cast<float>(i) / static_cast<float>(count - 1));
  return times;
}

// Writes the surfels of one time after another, and bakes them first if asked to.
class Exporter {
 public:
  Exporter(const ExportArguments& a, const DeviceArguments& devices, const TrainedRun& run,
           RunCapture& capture)
      : a_(a), run_(run), format_(format_of(a.format)) {
    if (!a.bake) return;
    cameras_ = capture.training_cameras();
    traced_ = run.subject;
    traced_.scene.move_to(devices.choose());
  }

  void write(std::optional<float> time, const std::string& suffix, const std::string& label) {
    Surfels main = viz::posed_main(run_.subject, time);
    if (a_.bake) main = baked(*time, main, label);
    for (const auto& path :
         viz::write_subject(run_.subject, time, std::move(main), a_.output, format_, suffix))
      fmt::print("{}\n", path.string());
  }

 private:
  Surfels baked(float time, const Surfels& main, const std::string& label) {
    const std::atomic<bool>& stop = stop_on_signals();
    const auto start = std::chrono::steady_clock::now();
    CountProgress progress = CountProgress::for_stderr();
    viz::Baked result = viz::bake(traced_, time, main, cameras_, harmonics_ ? &*harmonics_ : nullptr,
                                  [&](int64_t done, int64_t all) {
                                    progress.show({label, "images baked", done, all}, seconds_since(start));
                                    return !stop;
                                  });
    progress.finish();
    if (stop) throw Exit{exit_interrupted};
    fmt::print(
        "{:.2f} dB against the images with reflections, {:.2f} dB without baking ({} cameras, time {:.3f})\n",
        result.psnr, result.psnr_without, cameras_.size(), time);
    harmonics_ = result.main.sh;
    return std::move(result.main);
  }

  const ExportArguments& a_;
  const TrainedRun& run_;
  viz::SplatFormat format_;
  std::vector<Camera<float>> cameras_;
  viz::Subject traced_;                     // on the device
  std::optional<Tensor<float>> harmonics_;  // of the time before
};

void run_export(const ExportArguments& a, const DeviceArguments& devices) {
  // CLI11's range check accepts "nan".
  check_option(a.time >= 0 && a.time <= 1, "time", a.time, "0 to 1");
  const viz::SplatFormat format = format_of(a.format);
  if (a.bake && format == viz::SplatFormat::surfel_ply)
    throw InputError("option", "bake", "it with --format 2dgs, which has reflections", "3dgs, spz or sog");
  const TrainedRun run = read_run(a.run);
  if (!run.note.empty()) std::cerr << run.note << std::endl;
  print_losses(run.subject, format, a.bake);
  RunCapture capture(run, a);
  const std::vector<float> times = times_in(a, capture);
  Exporter exporter(a, devices, run, capture);
  if (times.empty()) return exporter.write(a.undeformed ? std::nullopt : std::optional(a.time), "", "");
  for (size_t i = 0; i < times.size(); ++i)
    exporter.write(times[i], fmt::format("_{:04}", i), fmt::format("time {}/{}", i + 1, times.size()));
}

}  // namespace

void add_export(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("export", "Write a run's surfels for other programs");
  const auto a = std::make_shared<ExportArguments>();
  verb->add_option("RUN", a->run, "The run's folder")->required();
  verb->add_option("-o,--output", a->output, "Output folder")->required();
  std::vector<std::string> formats;
  for (const std::string_view name : enum_names(viz::SplatFormat())) formats.emplace_back(name);
  verb->add_option(
          "--format", a->format,
          "2dgs: .ply of surfels, with reflections for TraceFlow; 3dgs: .ply of thin Gaussians; spz; sog")
      ->check(CLI::IsMember(formats))
      ->capture_default_str();
  CLI::Option* time = verb->add_option("--time", a->time, "Time of the exported surfels, 0 to 1")
                          ->check(CLI::Range(0.0, 1.0))
                          ->capture_default_str();
  CLI::Option* times =
      verb->add_option("--times", a->times,
                       "Numbered files for several times: all of the capture, or N evenly spaced")
          ->excludes(time);
  verb->add_option("-d,--data", a->capture, "The capture, if it is no longer where the run was trained");
  CLI::Option* bake = verb->add_flag("--bake", a->bake,
                                     "Fit the harmonics to what the training cameras see with reflections");
  verb->add_flag("--undeformed", a->undeformed,
                 "Export the surfels as they are stored, without motion and light changes")
      ->excludes(time)
      ->excludes(times)
      ->excludes(bake);
  const DeviceArguments devices(*verb);
  verb->callback([a, devices] { run_export(*a, devices); });
}

}  // namespace traceflow::cli

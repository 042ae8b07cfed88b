#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <iostream>
#include <memory>
#include <optional>

#include "base/clock.h"
#include "cli/arguments/device_arguments.h"
#include "cli/arguments/option_arguments.h"
#include "cli/runs/load_capture_of.h"
#include "cli/terminal/count_progress.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"
#include "mesh/fuse_views.h"
#include "mesh/mesh_glb.h"
#include "mesh/mesh_ply.h"
#include "scene/viewpoint.h"
#include "viz/bake.h"
#include "viz/trajectories.h"

namespace traceflow::cli {

namespace {

constexpr int64_t most_times = 10000;
constexpr const char* trajectories = "trajectories";

struct ExportArguments {
  std::string scene, output, format = "2dgs", times, capture;
  float time = 0;
  bool undeformed = false, bake = false;
};

// The format of surfels; absent for meshes and trajectories.
std::optional<viz::SplatFormat> splat_format(const std::string& name) {
  const auto names = enum_names(viz::SplatFormat());
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) return std::nullopt;
  return static_cast<viz::SplatFormat>(found - names.begin());
}

struct ExportOptions {
  TracksOptions tracks;
  mesh::FusionOptions mesh;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("tracks_most", tracks.most, "points", "Trajectories: maximum number of points.");
    v.field("tracks_least_move", tracks.least_move, "extents",
            "Trajectories: minimum distance that a point must move within the video.");
    v.group("mesh", mesh);
  }
};

// What the files lack, on standard error.
void print_losses(const viz::Subject& subject, std::optional<viz::SplatFormat> format, bool bake) {
  if (!format || !subject.request.specular || subject.scene.specular == Specular::none || bake) return;
  if (*format != viz::SplatFormat::surfel_ply) {
    std::cerr << "the files are without reflections, which only 2dgs has: --bake adds them as harmonics\n";
  } else if (subject.scene.specular == Specular::environment_map) {
    std::cerr
        << "this run's reflections are a cube map, which a .ply cannot hold: main.ply alone is written\n";
  } else if (subject.scene.environment_map) {
    std::cerr << "the cube map behind this run's environment is left out: a .ply cannot hold one\n";
  }
}

// The scene's capture, read when it is first needed.
class SceneCapture {
 public:
  SceneCapture(const LoadedScene& scene, const ExportArguments& a) : scene_(scene), a_(a) {}
  const Capture& get() {
    if (!capture_) {
      if (!scene_.run && a_.capture.empty())
        throw InputError(a_.scene, "", "no capture", "a run, or -d CAPTURE");
      capture_ = load_capture_of(scene_, a_.capture, 0);
    }
    return *capture_;
  }
  std::vector<viz::Shot> training_shots() {
    std::vector<viz::Shot> shots;
    for (const View& view : views_of(get(), "train")) {
      shots.push_back({view.id, view.time,
                       renormalised(view.camera, get().normalisation, scene_.subject.scene.normalisation)});
    }
    return shots;
  }

 private:
  const LoadedScene& scene_;
  const ExportArguments& a_;
  std::optional<Capture> capture_;
};

// Empty: only --time.
std::vector<float> times_in(const ExportArguments& a, SceneCapture& capture) {
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

// Writes what the run shows at one time after another.
class Exporter {
 public:
  Exporter(const ExportArguments& a, const ExportOptions& options, const DeviceArguments& devices,
           const viz::Subject& subject, SceneCapture& capture)
      : a_(a), options_(options), subject_(subject), format_(splat_format(a.format)) {
    if (!a.bake && format_) return;
    shots_ = capture.training_shots();
    traced_ = subject;
    traced_.render.tracks = options.tracks;
    traced_.scene.move_to(devices.choose());
  }

  // label: of the time, in the progress.
  void write(std::optional<float> time, const std::string& suffix, const std::string& label) {
    if (stop_) throw Exit{exit_interrupted};
    if (a_.format == trajectories) return write_trajectories();
    if (!format_) return write_mesh(*time, suffix, label);
    Surfels main = viz::posed_main(subject_, time);
    if (a_.bake) main = baked(*time, main, label);
    for (const auto& path : viz::write_subject(subject_, time, std::move(main), a_.output, *format_, suffix))
      fmt::print("{}\n", path.string());
  }

 private:
  Surfels baked(float time, const Surfels& main, const std::string& label) {
    std::vector<Camera<float>> cameras;
    for (const viz::Shot& shot : shots_) cameras.push_back(shot.camera);
    CountProgress progress = CountProgress::for_stderr();
    const auto start = Clock::now();
    viz::Baked result = viz::bake(traced_, time, main, cameras, harmonics_ ? &*harmonics_ : nullptr,
                                  [&](int64_t done, int64_t all) {
                                    progress.show({label, "images baked", done, all}, seconds_since(start));
                                    return !stop_;
                                  });
    progress.finish();
    if (stop_) throw Exit{exit_interrupted};
    fmt::print(
        "{:.2f} dB against the images with reflections, {:.2f} dB without baking ({} cameras, time {:.3f})\n",
        result.psnr, result.psnr_without, cameras.size(), time);
    harmonics_ = result.main.sh;
    return std::move(result.main);
  }

  void write_trajectories() {
    CountProgress progress = CountProgress::for_stderr();
    const auto start = Clock::now();
    const viz::Trajectories paths = viz::follow_surfels(traced_, shots_, [&](size_t done, size_t all) {
      progress.show({"", "views", static_cast<int64_t>(done), static_cast<int64_t>(all)},
                    seconds_since(start));
      if (stop_) throw Exit{exit_interrupted};
    });
    progress.finish();
    const std::filesystem::path folder(a_.output);
    std::filesystem::create_directories(folder);
    viz::write_trajectories_npz(folder / "trajectories.npz", paths);
    viz::write_trajectories_glb(folder / "trajectories.glb", paths);
    fmt::print("{0}.npz, {0}.glb: {1} points, {2} views\n", (folder / "trajectories").string(), paths.count(),
               shots_.size());
  }

  void write_mesh(float time, const std::string& suffix, const std::string& label) {
    CountProgress progress = CountProgress::for_stderr();
    const auto start = Clock::now();
    const mesh::TriangleMesh mesh =
        mesh::fuse_views(traced_, shots_, time, options_.mesh, [&](size_t done, size_t all) {
          progress.show({label, "images fused", static_cast<int64_t>(done), static_cast<int64_t>(all)},
                        seconds_since(start));
          if (stop_) throw Exit{exit_interrupted};
        });
    progress.finish();
    const std::filesystem::path folder(a_.output), name = "mesh" + suffix;
    std::filesystem::create_directories(folder);
    mesh::write_mesh_ply(folder / (name.string() + ".ply"), mesh);
    mesh::write_mesh_glb(folder / (name.string() + ".glb"), mesh);
    fmt::print("{0}.ply, {0}.glb: {1} vertices, {2} triangles\n", (folder / name).string(),
               mesh.vertex_count(), mesh.triangle_count());
  }

  const ExportArguments& a_;
  const ExportOptions& options_;
  const viz::Subject& subject_;
  std::optional<viz::SplatFormat> format_;
  const std::atomic<bool>& stop_ = stop_on_signals();
  std::vector<viz::Shot> shots_;            // of the training cameras
  viz::Subject traced_;                     // on the device
  std::optional<Tensor<float>> harmonics_;  // of the time before
};

void run_export(const ExportArguments& a, const ExportOptions& options, const DeviceArguments& devices) {
  // CLI11's range check accepts "nan".
  check_option(a.time >= 0 && a.time <= 1, "time", a.time, "0 to 1");
  options.mesh.validate();
  options.tracks.validate();
  const std::optional<viz::SplatFormat> format = splat_format(a.format);
  if (a.bake && (!format || *format == viz::SplatFormat::surfel_ply))
    throw InputError("option", "bake", "it with --format " + a.format, "it with 3dgs, spz or sog");
  if (a.undeformed && !format)
    throw InputError("option", "undeformed", "it with --format " + a.format, "it with surfels or Gaussians");
  if (a.format == trajectories && (a.time != 0 || !a.times.empty()))
    throw InputError("option", a.times.empty() ? "time" : "times", "it with --format trajectories",
                     "neither: trajectories go through all times of the capture");
  LoadedScene scene = load_scene(a.scene, "");
  const viz::Subject& subject = scene.subject;
  if (!subject.warning.empty()) std::cerr << subject.warning << std::endl;
  print_losses(subject, format, a.bake);
  SceneCapture capture(scene, a);
  const std::vector<float> times = times_in(a, capture);
  if (!(subject.scene.extent > 0) && (a.bake || !format))
    scene.subject.scene.extent = viz::extent_seen_from(subject.scene.main, capture.training_shots());
  Exporter exporter(a, options, devices, subject, capture);
  if (times.empty()) return exporter.write(a.undeformed ? std::nullopt : std::optional(a.time), "", "");
  for (size_t i = 0; i < times.size(); ++i)
    exporter.write(times[i], fmt::format("_{:04}", i), fmt::format("time {}/{}", i + 1, times.size()));
}

}  // namespace

void add_export(CLI::App& program) {
  CLI::App* verb =
      program.add_subcommand("export", "Write surfels, Gaussians, a mesh or trajectories for other programs");
  const auto a = std::make_shared<ExportArguments>();
  verb->add_option("SCENE", a->scene, "A run's folder, a .ply or an .spz")->required();
  verb->add_option("-o,--output", a->output, "Output folder")->required();
  std::vector<std::string> formats;
  for (const std::string_view name : enum_names(viz::SplatFormat())) formats.emplace_back(name);
  formats.insert(formats.end(), {"mesh", trajectories});
  verb->add_option(
          "--format", a->format,
          "2dgs: .ply of surfels, with reflections for TraceFlow; 3dgs: .ply of thin Gaussians; spz; sog; "
          "mesh: .ply and .glb; trajectories: paths of moving surfels, .npz as from CoTracker and .glb")
      ->check(CLI::IsMember(formats))
      ->capture_default_str();
  CLI::Option* time = verb->add_option("--time", a->time, "Time of the exported surfels, 0 to 1")
                          ->check(CLI::Range(0.0, 1.0))
                          ->capture_default_str();
  CLI::Option* times =
      verb->add_option("--times", a->times,
                       "Numbered files for several times: all of the capture, or N evenly spaced")
          ->excludes(time);
  verb->add_option("-d,--data", a->capture,
                   "The capture, if it is no longer where the run was trained, or for a .ply or an .spz");
  CLI::Option* bake = verb->add_flag("--bake", a->bake,
                                     "Fit the harmonics to what the training cameras see with reflections");
  verb->add_flag("--undeformed", a->undeformed,
                 "Export the surfels as they are stored, without motion and light changes")
      ->excludes(time)
      ->excludes(times)
      ->excludes(bake);
  const auto options = std::make_shared<ExportOptions>();
  const OptionArguments given(*verb, option_fields(*options));
  const DeviceArguments devices(*verb);
  verb->callback([a, options, given, devices] {
    given.apply(option_fields(*options));
    run_export(*a, *options, devices);
  });
}

}  // namespace traceflow::cli

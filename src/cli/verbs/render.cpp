#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>

#include "base/clock.h"
#include "cli/arguments/device_arguments.h"
#include "cli/arguments/option_arguments.h"
#include "cli/runs/load_capture_of.h"
#include "cli/runs/render_shots.h"
#include "cli/terminal/count_progress.h"
#include "cli/terminal/error_boundary.h"
#include "cli/terminal/stop_request.h"
#include "cli/verbs/verbs.h"
#include "files/png.h"
#include "viz/layer_files.h"
#include "viz/video.h"

namespace traceflow::cli {

namespace {

struct RenderArguments {
  std::string scene, output, environment, layers = "rgb", format = "png", video;
  ShotArguments shots;

  void check() const {
    if (output.empty() && video.empty())
      throw InputError("option", "output", "nothing", "-o DIR, --video FILE.mp4 or both");
    shots.check();
    if (!video.empty()) viz::Video::prepare(video);
  }
};

// Where the pictures go: files, a video, or both.
class Output {
 public:
  Output(const RenderArguments& a, const ChosenShots& chosen, double scale)
      : a_(a),
        chosen_(chosen),
        layers_(viz::parse_layers(a.layers)),
        scale_(scale),
        files_(a.output, layers_, a.format == "npy" ? viz::ImageFormat::npy : viz::ImageFormat::png, scale),
        video_(a.video, chosen.frames_per_second) {}

  void add(size_t i, const Frame& frame, const viz::Tracks& tracks) {
    const std::string& name = chosen_.shots[i].name;
    if (!a_.output.empty()) files_.write(name, frame, tracks);
    if (a_.video.empty() && !a_.shots.compare) return;
    Tensor<uint8_t> picture =
        viz::in_colour(painter_.paint(layers_[0], viz::layer_values(frame, layers_[0], scale_, tracks)));
    if (a_.shots.compare) {
      const std::shared_ptr<const ViewImages> images = load_images(*chosen_.capture, chosen_.photographs[i]);
      picture = viz::side_by_side(to_8bit(images->colour), picture);
      if (!a_.output.empty()) write_compared(name, picture);
    }
    if (!a_.video.empty()) video_.add(picture);
  }
  void finish() { video_.finish(); }

 private:
  void write_compared(const std::string& name, const Tensor<uint8_t>& picture) const {
    const std::filesystem::path path = std::filesystem::path(a_.output) / "compare" / (name + ".png");
    std::filesystem::create_directories(path.parent_path());
    write_png(path, picture);
  }

  const RenderArguments& a_;
  const ChosenShots& chosen_;
  std::vector<viz::Layer> layers_;
  double scale_;
  viz::LayerFiles files_;
  viz::Video video_;
  viz::Painter painter_;
};

// The capture's times, if it is available.
std::vector<float> times_for_tracks(const RenderArguments& a, const LoadedScene& scene,
                                    const ChosenShots& chosen) {
  const bool is_there =
      scene.run && (!a.shots.capture.empty() || std::filesystem::exists(scene.run->capture_folder));
  if (!chosen.times.empty() || !is_there) return chosen.times;
  return times_of(load_capture_of(scene, a.shots.capture, a.shots.downscale));
}

// Renders until the end or Ctrl-C. Returns the number of rendered shots.
size_t take(const std::vector<viz::Shot>& shots, const viz::Subject& subject,
            const viz::TrackFollower* follower, Output& output) {
  const std::atomic<bool>& stop = stop_on_signals();
  const auto start = std::chrono::steady_clock::now();
  CountProgress progress = CountProgress::for_stderr();
  Renderer renderer(subject.render);
  size_t done = 0;
  while (done < shots.size() && !stop) {
    FrameRequest request = subject.request;
    request.camera = shots[done].camera;
    request.time = *shots[done].time;
    output.add(done, renderer.forward(subject.scene, request),
               follower != nullptr ? follower->at(subject.scene, request.time) : viz::Tracks());
    ++done;
    progress.show({"", "frames", static_cast<int64_t>(done), static_cast<int64_t>(shots.size())},
                  seconds_since(start));
  }
  output.finish();
  progress.finish();
  return done;
}

void run_render(const RenderArguments& a, const OptionArguments& options, const DeviceArguments& devices) {
  a.check();
  const std::vector<viz::Layer> layers = viz::parse_layers(a.layers);
  LoadedScene scene = load_scene(a.scene, a.environment);
  viz::Subject& subject = scene.subject;
  options.apply(option_fields(subject.render));
  subject.render.validate();
  const ChosenShots chosen = choose_shots(a.shots, scene);
  if (!(subject.scene.extent > 0))
    subject.scene.extent = viz::extent_seen_from(subject.scene.main, chosen.shots);
  if (!subject.warning.empty()) std::cerr << subject.warning << std::endl;
  subject.scene.move_to(devices.choose());

  std::optional<viz::TrackFollower> follower;
  if (std::ranges::find(layers, viz::Layer::tracks) != layers.end())
    follower.emplace(subject.scene, subject.request, subject.render, times_for_tracks(a, scene, chosen));
  Output output(a, chosen, subject.scene.normalisation.scale);
  const size_t done = take(chosen.shots, subject, follower ? &*follower : nullptr, output);
  std::string where = a.output;
  if (!a.video.empty()) where += (where.empty() ? "" : " and ") + a.video;
  if (done < chosen.shots.size()) {
    std::cerr << fmt::format("stopped after {} of {} frames: {}\n", done, chosen.shots.size(),
                             done > 0 ? where : "nothing was written");
    throw Exit{exit_interrupted};
  }
  fmt::print("{} views of {} surfels: {}\n", done, subject.scene.main.count(), where);
}

}  // namespace

void add_render(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("render", "Render a run, a .ply or an .spz");
  const auto a = std::make_shared<RenderArguments>();
  verb->add_option("SCENE", a->scene, "A run's folder, a .ply, an .spz or a folder written by export")
      ->required();
  verb->add_option("-o,--output", a->output, "Output folder for LAYER/NAME.png or .npy");
  verb->add_option("--environment", a->environment,
                   "A second .ply, with the surfels that the first one reflects");
  add_shot_arguments(*verb, a->shots);
  verb->add_option("--layers", a->layers,
                   "Layers to render, separated by commas: rgb, diffuse, specular, tint, roughness, alpha, "
                   "normal, depth, median-depth, distortion, surfels, tracks; or all")
      ->capture_default_str();
  verb->add_option("--format", a->format,
                   "Format of the output files: png (for viewing) or npy (float32 values)")
      ->check(CLI::IsMember({"png", "npy"}))
      ->capture_default_str();
  verb->add_option("--video", a->video, "Video of the first layer, encoded with ffmpeg: FILE.mp4");
  const auto defaults = std::make_shared<RenderOptions>();
  const OptionArguments options(*verb, option_fields(*defaults));
  verb->footer(
      "The defaults in brackets are those of a .ply that names none. A run has those of its training.");
  const DeviceArguments devices(*verb);
  verb->callback([a, defaults, options, devices] { run_render(*a, options, devices); });
}

}  // namespace traceflow::cli

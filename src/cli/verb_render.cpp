#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "cli/device_arguments.h"
#include "cli/option_arguments.h"
#include "cli/trained_run.h"
#include "cli/verbs.h"
#include "show/camera_file.h"
#include "show/layer_files.h"
#include "show/orbit.h"
#include "show/video.h"

namespace traceflow::cli {

namespace {

struct RenderArguments {
  std::string scene, output, environment, capture, split, cameras, layers = "rgb", format = "png", video;
  std::optional<float> time;
  bool orbit = false;
  int frames = 120;
  int downscale = 0;
  std::pair<int, int> size = {640, 360};
  double frames_per_second = 30;
};

// A scene to render and, when it comes from a run, what else is known of it.
struct Loaded {
  show::Subject subject;
  std::optional<TrainedRun> run;
};

Loaded load(const RenderArguments& a) {
  const std::filesystem::path path(a.scene);
  if (std::filesystem::is_regular_file(path))
    return {show::read_ply_subject(path, a.environment), std::nullopt};
  if (std::filesystem::is_regular_file(path / "main.ply")) {
    return {show::read_ply_subject(path / "main.ply", a.environment), std::nullopt};
  }
  if (!std::filesystem::exists(path)) {
    throw InputError(path.string(), "", "no such file or folder", "a run's folder or a .ply");
  }
  if (!a.environment.empty()) {
    throw InputError("option", "environment", "a run, which has its own", "a .ply to go with");
  }
  TrainedRun run = read_run(path);
  show::Subject subject = std::move(run.subject);
  subject.warning = run.note;
  return {std::move(subject), std::move(run)};
}

Capture capture_for(const RenderArguments& a, const Loaded& loaded) {
  if (loaded.run) return capture_of(*loaded.run, a.capture, a.downscale);
  if (a.capture.empty()) {
    throw InputError(a.scene, "", "a .ply, which has no cameras", "--cameras FILE, --orbit, or -d CAPTURE");
  }
  CaptureOptions options;
  if (a.downscale > 0) options.downscale = a.downscale;
  return load_capture(a.capture, options);
}

// A capture's camera where the scene is: a .ply stands in the capture's own coordinates.
Camera<float> camera_for(const Loaded& loaded, const Capture& capture, Camera<float> camera) {
  if (loaded.run) return camera;
  const SceneNormalisation& n = capture.normalisation;
  camera.position = Vec3<float>(Vec3<double>(camera.position) / n.scale + n.centre);
  return camera;
}

std::vector<show::Shot> split_shots(const RenderArguments& a, const Loaded& loaded) {
  const Capture capture = capture_for(a, loaded);
  std::vector<show::Shot> shots;
  for (const View& view : views_of(capture, a.split.empty() ? "test" : a.split)) {
    show::check_name(capture.folder.string(), "view id", view.id);
    shots.push_back({view.id, view.time, camera_for(loaded, capture, view.camera)});
  }
  return shots;
}

std::vector<show::Shot> orbit_shots(const RenderArguments& a, const Loaded& loaded) {
  if (!loaded.run && a.capture.empty()) {
    return show::orbit_around_points(loaded.subject.scene.main.position, a.size.first, a.size.second,
                                     a.frames);
  }
  const Capture capture = capture_for(a, loaded);
  std::vector<Camera<float>> cameras;
  for (const View& view : views_of(capture, "train"))
    cameras.push_back(camera_for(loaded, capture, view.camera));
  std::vector<show::Shot> shots = show::orbit_around_cameras(cameras, a.frames);
  // The scene moves while the camera does, once from beginning to end.
  for (size_t i = 0; i < shots.size(); ++i) {
    shots[i].time =
        static_cast<float>(static_cast<double>(i) / std::max<double>(1, static_cast<double>(a.frames - 1)));
  }
  return shots;
}

std::vector<show::Shot> choose_shots(const RenderArguments& a, const Loaded& loaded) {
  if (!a.cameras.empty()) return show::read_cameras(a.cameras, loaded.subject.scene.normalisation);
  return a.orbit ? orbit_shots(a, loaded) : split_shots(a, loaded);
}

void check_arguments(const RenderArguments& a) {
  if (a.output.empty() && a.video.empty()) {
    throw InputError("option", "output", "nothing", "-o DIR, --video FILE.mp4 or both");
  }
  // The parser's range lets "nan" through.
  if (a.time) check_option(*a.time >= 0 && *a.time <= 1, "time", *a.time, "0 to 1");
  if (!a.video.empty()) show::Video::prepare(a.video);
}

void run_render(const RenderArguments& a, const OptionArguments& options, const DeviceArguments& devices) {
  check_arguments(a);
  const std::vector<show::Layer> layers = show::parse_layers(a.layers);
  Loaded loaded = load(a);
  show::Subject& subject = loaded.subject;
  options.apply(option_fields(subject.render));
  subject.render.validate();
  const std::vector<show::Shot> shots = choose_shots(a, loaded);
  if (!(subject.scene.extent > 0)) subject.scene.extent = show::extent_seen_from(subject.scene.main, shots);
  if (!subject.warning.empty()) fmt::print(stderr, "{}\n", subject.warning);

  subject.scene.move_to(devices.choose());

  const double scale = subject.scene.normalisation.scale;
  show::LayerFiles files(a.output, layers,
                         a.format == "npy" ? show::ImageFormat::npy : show::ImageFormat::png, scale);
  show::Video video(a.video, a.frames_per_second);
  show::Painter painter;
  Renderer renderer(subject.render);
  for (const show::Shot& shot : shots) {
    FrameRequest request = subject.request;
    request.camera = shot.camera;
    request.time = a.time ? *a.time : shot.time.value_or(0.0F);
    const Frame& frame = renderer.forward(subject.scene, request);
    if (!a.output.empty()) files.write(shot.name, frame);
    if (!a.video.empty()) {
      video.add(show::in_colour(painter.paint(layers[0], show::layer_values(frame, layers[0], scale))));
    }
  }
  video.finish();
  fmt::print("{} views of {} surfels: {}\n", shots.size(), subject.scene.main.count(),
             a.output.empty() ? a.video : a.output);
}

// "640x360".
std::pair<int, int> parse_size(const std::string& text) {
  int width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width < 1 || height < 1 ||
      width > 16384 || height > 16384) {
    throw InputError("option", "size", text, "WIDTHxHEIGHT, each 1 to 16384");
  }
  return {width, height};
}

}  // namespace

void add_render(CLI::App& program) {
  CLI::App* verb = program.add_subcommand("render", "Render a run or a 2DGS .ply");
  const auto a = std::make_shared<RenderArguments>();
  verb->add_option("SCENE", a->scene, "A run's folder, a 2DGS .ply, or a folder that export wrote")
      ->required();
  verb->add_option("-o,--output", a->output, "Folder for LAYER/NAME.png or .npy");
  verb->add_option("--environment", a->environment, "Surfels that a .ply reflects, a .ply as well");
  CLI::Option* split =
      verb->add_option("--split", a->split, "The capture's views of this split: test (default) or train")
          ->check(CLI::IsMember({"test", "train"}));
  CLI::Option* cameras =
      verb->add_option("--cameras", a->cameras, "Cameras, a cameras.json as 3DGS and 2DGS write it")
          ->excludes(split);
  verb->add_flag("--orbit", a->orbit, "A path around what the cameras look at")
      ->excludes(split)
      ->excludes(cameras);
  verb->add_option("--frames", a->frames, "Frames of the orbit")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  verb->add_option_function<std::string>(
          "--size", [a](const std::string& text) { a->size = parse_size(text); }, "Size of a .ply's orbit")
      ->default_str("640x360");
  verb->add_option("--time", a->time, "One time for all views, 0 to 1; else each view's own")
      ->check(CLI::Range(0.0, 1.0));
  verb->add_option("-d,--data", a->capture, "The capture's folder, where it is not where the run found it");
  verb->add_option("--downscale", a->downscale, "Another size of the capture than the run was trained at")
      ->check(CLI::Range(1, 64));
  verb->add_option("--layers", a->layers,
                   "Of rgb, diffuse, specular, tint, alpha, normal, depth, median-depth, distortion, "
                   "surfels, with commas between; or all")
      ->capture_default_str();
  verb->add_option("--format", a->format, "png for the eye or npy (float32)")
      ->check(CLI::IsMember({"png", "npy"}))
      ->capture_default_str();
  verb->add_option("--video", a->video, "Film of the first layer, by ffmpeg");
  verb->add_option("--fps", a->frames_per_second, "Frames a second of the film")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  const auto defaults = std::make_shared<RenderOptions>();
  const OptionArguments options(*verb, option_fields(*defaults));
  const DeviceArguments devices(*verb);
  verb->callback([a, defaults, options, devices] { run_render(*a, options, devices); });
}

}  // namespace traceflow::cli

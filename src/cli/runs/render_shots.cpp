#include "cli/runs/render_shots.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <map>

#include "cli/runs/load_capture_of.h"
#include "scene/viewpoint.h"
#include "viz/cameras/camera_file.h"
#include "viz/cameras/camera_path.h"
#include "viz/cameras/orbit.h"
#include "viz/cameras/spiral.h"

namespace traceflow::cli {

namespace {

constexpr int usual_frames = 120;
constexpr std::pair<int, int> usual_size = {640, 360};

[[noreturn]] void refuse(const char* option, const std::string& found, const std::string& expected) {
  throw InputError("option", option, found, expected);
}

// Parses "640x360".
std::pair<int, int> parse_size(const std::string& text) {
  int width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width < 1 || height < 1 ||
      width > 16384 || height > 16384) {
    throw InputError("option", "size", text, "WIDTHxHEIGHT, each 1 to 16384");
  }
  return {width, height};
}

// Keeps the vertical field of view.
Camera<float> resized(Camera<float> camera, std::pair<int, int> size) {
  const float scale = static_cast<float>(size.second) / static_cast<float>(camera.height);
  camera.centre_x =
      static_cast<float>(size.first) / 2 + scale * (camera.centre_x - static_cast<float>(camera.width) / 2);
  camera.centre_y *= scale;
  camera.focal_x *= scale;
  camera.focal_y *= scale;
  std::tie(camera.width, camera.height) = size;
  return camera;
}

// Chooses shots from all data of the scene. The capture is only read if needed.
class Chooser {
 public:
  Chooser(const ShotArguments& arguments, const LoadedScene& scene) : a_(arguments), scene_(scene) {}

  ChosenShots choose() {
    ChosenShots chosen;
    chosen.frames_per_second = a_.frames_per_second.value_or(30);
    if (!a_.cameras.empty()) {
      chosen.shots = viz::read_cameras(a_.cameras, scene_.subject.scene.normalisation);
    } else if (!a_.camera_path.empty()) {
      along_path(chosen);
    } else if (!a_.freeze_camera.empty()) {
      frozen(chosen);
    } else if (a_.orbit || a_.spiral) {
      around(chosen);
    } else {
      captured(chosen);
    }
    for (viz::Shot& shot : chosen.shots) shot.time = a_.time ? *a_.time : shot.time.value_or(0.0F);
    if (capture_) chosen.times = times_of(*capture_);
    if (chosen.photographs.empty()) return chosen;
    chosen.capture = std::move(capture_);
    return chosen;
  }

 private:
  const Capture& capture() {
    if (capture_) return *capture_;
    if (!scene_.run && a_.capture.empty()) {
      throw InputError("a .ply", "", "no cameras",
                       "--cameras FILE, --camera-path FILE, --orbit, or -d CAPTURE");
    }
    capture_ = load_capture_of(scene_, a_.capture, a_.downscale);
    return *capture_;
  }

  // A capture's camera in the scene's coordinates: a .ply has the capture's own coordinates.
  Camera<float> placed(const Camera<float>& camera) {
    return renormalised(camera, capture().normalisation, scene_.subject.scene.normalisation);
  }

  void captured(ChosenShots& chosen) {
    for (const View& view : views_of(capture(), a_.split.empty() ? "test" : a_.split)) {
      viz::check_name(capture().folder.string(), "view id", view.id);
      chosen.shots.push_back({view.id, view.time, placed(view.camera)});
      if (a_.compare) chosen.photographs.push_back(view);
    }
  }

  void along_path(ChosenShots& chosen) {
    viz::CameraPath path = viz::read_camera_path(a_.camera_path);
    if (a_.size) std::tie(path.width, path.height) = *a_.size;
    if (a_.frames_per_second) path.fps = *a_.frames_per_second;
    chosen.shots = viz::shots_of(path, scene_.subject.scene.normalisation);
    chosen.frames_per_second = path.fps;
  }

  // Time runs once from beginning to end while the camera moves.
  void around(ChosenShots& chosen) {
    const int frames = a_.frames.value_or(usual_frames);
    if (a_.orbit && !scene_.run && a_.capture.empty()) {
      const auto [width, height] = a_.size.value_or(usual_size);
      chosen.shots = viz::orbit_around_points(scene_.subject.scene.main.position, width, height, frames);
      return;
    }
    std::vector<Camera<float>> cameras;
    for (const View& view : views_of(capture(), "train")) cameras.push_back(placed(view.camera));
    if (a_.size) cameras.front() = resized(cameras.front(), *a_.size);
    chosen.shots =
        a_.orbit ? viz::orbit_around_cameras(cameras, frames) : viz::spiral_around_cameras(cameras, frames);
    for (size_t i = 0; i < chosen.shots.size(); ++i) chosen.shots[i].time = evenly(i, chosen.shots.size());
  }

  static float evenly(size_t i, size_t count) {
    return static_cast<float>(static_cast<double>(i) / std::max<double>(1, static_cast<double>(count) - 1));
  }

  // Finds a view by its id, in either split, or by its index in the split.
  const View& view_to_freeze() {
    const std::string split = a_.split.empty() ? "test" : a_.split;
    const std::vector<View>& first = split == "train" ? capture().train : capture().test;
    for (const std::vector<View>* list : {&first, &capture().test, &capture().train}) {
      const auto found = std::ranges::find(*list, a_.freeze_camera, &View::id);
      if (found != list->end()) return *found;
    }
    // Only after the search by id: a capture without test views can still freeze a training view.
    const std::vector<View>& views = views_of(capture(), split);
    const std::string& text = a_.freeze_camera;
    size_t index = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
    if (error != std::errc() || end != text.data() + text.size() || index >= views.size()) {
      throw InputError("option", "freeze-camera", text,
                       fmt::format("a view's id, as {}, or its place in the {} views, 0 to {}",
                                   views.front().id, split, views.size() - 1));
    }
    return views[index];
  }

  static bool has_size_of(const Camera<float>& a, const Camera<float>& b) {
    return a.width == b.width && a.height == b.height;
  }

  // For each time of the capture, the view nearest to the camera. Views of the camera's size come first,
  // since only their photographs can be compared.
  std::map<float, const View*> moments(const Camera<float>& camera) {
    std::map<float, const View*> nearest;
    const auto away = [&](const View* view) {
      const Vec3<float> d = view->camera.position - camera.position;
      return std::pair(!has_size_of(view->camera, camera), dot(d, d));
    };
    for (const std::vector<View>* views : {&capture().test, &capture().train}) {
      for (const View& view : *views) {
        const View*& best = nearest[view.time];
        if (best == nullptr || away(&view) < away(best)) best = &view;
      }
    }
    return nearest;
  }

  // Checked before anything is rendered.
  static void check_beside(const View& view, const Camera<float>& camera) {
    if (has_size_of(view.camera, camera)) return;
    const Camera<float>& other = view.camera;
    refuse(
        "compare", fmt::format("{} of {}×{} at time {:.3f}", view.id, other.width, other.height, view.time),
        fmt::format("a photograph of {}×{}, the frozen camera's size: leave --compare out, or freeze another",
                    camera.width, camera.height));
  }

  void frozen(ChosenShots& chosen) {
    Camera<float> camera = view_to_freeze().camera;
    const std::map<float, const View*> times = moments(camera);
    if (a_.size) camera = resized(camera, *a_.size);
    camera = placed(camera);
    const auto add = [&](float time) {
      chosen.shots.push_back({fmt::format("{:05}", chosen.shots.size()), time, camera});
    };
    if (a_.frames) {
      const auto count = static_cast<size_t>(*a_.frames);
      for (size_t i = 0; i < count; ++i) add(evenly(i, count));
      return;
    }
    for (const auto& [time, view] : times) {
      add(time);
      if (!a_.compare) continue;
      check_beside(*view, camera);
      chosen.photographs.push_back(*view);
    }
  }

  const ShotArguments& a_;
  const LoadedScene& scene_;
  std::optional<Capture> capture_;
};

}  // namespace

void ShotArguments::check() const {
  std::vector<const char*> ways;
  if (!split.empty() && freeze_camera.empty()) ways.push_back("--split");
  if (!cameras.empty()) ways.push_back("--cameras");
  if (!camera_path.empty()) ways.push_back("--camera-path");
  if (orbit) ways.push_back("--orbit");
  if (spiral) ways.push_back("--spiral");
  if (!freeze_camera.empty()) ways.push_back("--freeze-camera");
  if (ways.size() > 1) {
    throw InputError("option", "", fmt::format("{} and {}", ways[0], ways[1]),
                     "one of them: each says where the cameras are");
  }
  const std::string way = ways.empty() ? "--split" : ways[0];
  const bool made = orbit || spiral || !freeze_camera.empty();
  // CLI11's range check accepts "nan".
  if (time) check_option(*time >= 0 && *time <= 1, "time", *time, "0 to 1");
  if (time && !freeze_camera.empty())
    refuse("freeze-time", "it together with --freeze-camera, by which nothing would move", "one of them");
  if (frames && !made) refuse("frames", "it with " + way, "--orbit, --spiral or --freeze-camera to go with");
  if (size && !made && camera_path.empty())
    refuse("size", "it with " + way + ", whose cameras have sizes",
           "--orbit, --spiral, --freeze-camera or --camera-path to go with");
  if (!compare) return;
  if (way != "--split" && way != "--freeze-camera")
    refuse("compare", "it with " + way + ", where no photograph was taken",
           "--split or --freeze-camera to go with");
  if (time) refuse("compare", "it with --time, when most photographs were not taken", "one of them");
  if (frames) refuse("compare", "it with --frames", "the times of the photographs: leave --frames out");
  if (size)
    refuse("compare", "it with --size", "the size of the photographs: leave --size out, or use --downscale");
}

void add_shot_arguments(CLI::App& verb, ShotArguments& a) {
  verb.add_option("--split", a.split, "Cameras of the capture's views in this split: test (default) or train")
      ->check(CLI::IsMember({"test", "train"}));
  verb.add_option("--cameras", a.cameras, "Cameras of a cameras.json, as written by 3DGS and 2DGS");
  verb.add_option("--camera-path", a.camera_path,
                  "Smooth path through keyframes, from a file that the viewer saved");
  verb.add_flag("--orbit", a.orbit, "Path around the point that the cameras look at");
  verb.add_flag("--spiral", a.spiral, "Spiral around the mean of the cameras, as in LLFF and NeRF");
  verb.add_option("--freeze-camera", a.freeze_camera,
                  "Camera of one captured view, by its id or its index in --split (from 0), while time runs")
      ->option_text("ID|N");
  verb.add_option("--time,--freeze-time", a.time,
                  "One time for all pictures, 0 to 1; otherwise each has its own")
      ->check(CLI::Range(0.0, 1.0));
  verb.add_option("--frames", a.frames,
                  fmt::format("Number of frames of an orbit or a spiral (default {}), or of a frozen camera "
                              "(default: the capture's times)",
                              usual_frames))
      ->check(CLI::Range(1, 100000));
  verb.add_option_function<std::string>(
          "--size", [&a](const std::string& text) { a.size = parse_size(text); },
          "Size of the pictures of a path; default: that of the cameras, or 640x360 for the orbit of a .ply")
      ->option_text("WIDTHxHEIGHT");
  verb.add_option("--fps", a.frames_per_second,
                  "Frames per second of the video; default: 30, or the value in the camera path")
      ->check(CLI::Range(0.1, 1000.0));
  verb.add_flag(
      "--compare", a.compare,
      "Put the photograph left of the render, for captured views or at each time of a frozen camera");
  verb.add_option("-d,--data", a.capture,
                  "The capture, a folder or a zip archive, if it has moved since training")
      ->option_text("CAPTURE");
  verb.add_option("--downscale", a.downscale,
                  "Use the capture at 1/K of the full image size; default: the size used in training")
      ->check(CLI::Range(1, 64));
}

ChosenShots choose_shots(const ShotArguments& arguments, const LoadedScene& scene) {
  return Chooser(arguments, scene).choose();
}

}  // namespace traceflow::cli

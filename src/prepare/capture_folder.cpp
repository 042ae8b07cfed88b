#include "prepare/capture_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <set>
#include <system_error>

#include "base/error.h"
#include "base/parallel.h"
#include "base/robust.h"
#include "capture/formats/nerfies/nerfies_writer.h"
#include "capture/lens/resample.h"
#include "files/npy.h"
#include "files/png.h"
#include "prepare/masks.h"
#include "prepare/motion/moving_mask.h"
#include "prepare/programs.h"
#include "prepare/scene_bounds.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

constexpr const char* marker = "prepare.json";
constexpr std::array<const char*, 9> own_names{"rgb",           "camera",       "mask",
                                               "motion_mask",   "points.npy",   "scene.json",
                                               "metadata.json", "dataset.json", marker};

// A frame with its pose.
struct PosedFrame {
  const Frame* frame = nullptr;
  Lens lens;
  double zoom = 1;
  Camera<double> camera;  // undistorted, in COLMAP's coordinates
};

Camera<double> straightened_camera(const Lens& lens, double zoom, const ColmapImage& image) {
  Camera<double> camera;
  camera.width = static_cast<int>(lens.width);
  camera.height = static_cast<int>(lens.height);
  camera.focal_x = zoom * lens.focal.x;
  camera.focal_y = zoom * lens.focal.y;
  camera.centre_x = lens.centre.x;
  camera.centre_y = lens.centre.y;
  camera.camera_from_world = image.camera_from_world;
  camera.position = image.position;
  return camera;
}

std::vector<PosedFrame> posed_frames(const CaptureParts& parts) {
  std::map<int64_t, Lens> lenses;
  std::map<int64_t, double> zooms;
  for (const ColmapCamera& camera : parts.model.cameras) {
    lenses[camera.id] = camera.lens;
    zooms[camera.id] = pinhole_zoom(camera.lens, "COLMAP's camera " + std::to_string(camera.id));
  }
  std::map<std::string, const ColmapImage*> images;
  for (const ColmapImage& image : parts.model.images) images[image.name] = &image;
  std::vector<PosedFrame> posed;
  for (const Frame& frame : parts.frames.frames) {
    const auto found = images.find(frame.id + ".png");
    if (found == images.end()) continue;
    const ColmapImage& image = *found->second;
    const Lens& lens = lenses.at(image.camera_id);
    const double zoom = zooms.at(image.camera_id);
    posed.push_back({&frame, lens, zoom, straightened_camera(lens, zoom, image)});
  }
  return posed;
}

// Each size shows the whole image, even if a side is not divisible: readers scale the camera to the stored
// size.
void write_halved(const Tensor<float>& image, const fs::path& folder, const std::string& name) {
  for (const int factor : {1, 2, 4}) {
    const int64_t width = image.dim(1) / factor, height = image.dim(0) / factor;
    if (std::min(width, height) < 1) break;
    const Grid grid{width, height, static_cast<double>(image.dim(1)) / static_cast<double>(width),
                    static_cast<double>(image.dim(0)) / static_cast<double>(height)};
    write_png(folder / fmt::format("{}x", factor) / name, to_8bit(resample(image, grid)));
  }
}

Tensor<float> straight(const PosedFrame& posed, const Tensor<uint8_t>& picture) {
  Tensor<float> image = from_8bit(picture);
  return posed.lens.is_pinhole() ? image : straighten(image, posed.lens, posed.zoom);
}

void write_pictures(const std::vector<PosedFrame>& posed, const fs::path& pictures, const fs::path& folder,
                    const Work& work) {
  const auto count = static_cast<int64_t>(posed.size());
  std::atomic<int64_t> done = 0;
  parallel_for(
      "prepare: pictures", count,
      [&](int64_t i) {
        work.check();
        const PosedFrame& p = posed[static_cast<size_t>(i)];
        const std::string name = p.frame->id + ".png";
        write_halved(straight(p, read_png(pictures / name)), folder / "rgb", name);
        work.tell(++done, count);
      },
      1);
}

void write_given_masks(const std::vector<PosedFrame>& posed, const fs::path& masks, const fs::path& folder) {
  for (const PosedFrame& p : posed) {
    const fs::path file = masks / (p.frame->id + ".png");
    if (!fs::exists(file)) continue;
    const Tensor<uint8_t> mask = as_mask(to_8bit(straight(p, read_png(file))));
    write_mask(folder / "mask/1x" / (p.frame->id + ".png.png"), mask);
  }
}

PlacedCamera placed(const Camera<double>& camera) {
  Mat3<double> pixels(1);
  pixels[0][0] = camera.focal_x;
  pixels[1][1] = camera.focal_y;
  // Tracks have their origin at the centre of the first pixel.
  pixels[2] = Vec3<double>(camera.centre_x - 0.5, camera.centre_y - 0.5, 1);
  return {pixels, camera.camera_from_world, camera.position};
}

// Returns nothing for two cameras at nearly one place: they have no useful epipolar lines.
std::optional<TwoView> lines_between(const PosedFrame& a, const PosedFrame& b, double typical_depth) {
  constexpr double least_parallax = 2;  // pixels, at the typical depth
  const double parallax = length(a.camera.position - b.camera.position) / typical_depth * a.camera.focal_x;
  if (parallax < least_parallax) return std::nullopt;
  return epipolar_lines(placed(a.camera), placed(b.camera));
}

void write_estimated_masks(const std::vector<PosedFrame>& posed, double typical_depth, const fs::path& folder,
                           const Work& work) {
  for (const int camera : {0, 1}) {
    std::vector<const PosedFrame*> mine;
    std::vector<fs::path> files;
    for (const PosedFrame& p : posed) {
      if (p.frame->camera != camera) continue;
      mine.push_back(&p);
      files.push_back(folder / "rgb/1x" / (p.frame->id + ".png"));
    }
    estimate_masks(
        files,
        [&](int64_t i, int64_t j) {
          return lines_between(*mine[static_cast<size_t>(i)], *mine[static_cast<size_t>(j)], typical_depth);
        },
        work,
        [&](int64_t i, const Tensor<uint8_t>& mask) {
          write_mask(folder / "motion_mask/1x" / (mine[static_cast<size_t>(i)]->frame->id + ".png.png"),
                     mask);
        });
  }
}

double typical_depth(const std::vector<Vec3<double>>& points, const std::vector<Camera<double>>& cameras) {
  std::vector<double> depths;
  for_each_sampled_pair(points, cameras, [&](const Vec3<double>& point, const Camera<double>& camera) {
    const double z = camera.point_in_camera(point).z;
    if (z > 0) depths.push_back(z);
  });
  return depths.empty() ? 1 : median(std::move(depths));
}

// Milliseconds or, for images without times, their indices.
int64_t time_of(const Frame& frame) {
  return std::llround(frame.is_of_film() ? 1000 * frame.time : frame.time);
}

std::vector<NerfiesView> views_of(const PrepareOptions& options, const std::vector<PosedFrame>& posed) {
  std::vector<NerfiesView> views;
  const bool split = options.test_video.empty();
  int64_t order = 0;
  for (const PosedFrame& p : posed) {
    const bool is_test = split ? order % options.test_every == options.test_every / 2 : p.frame->camera == 1;
    views.push_back({p.frame->id, p.camera, time_of(*p.frame), order, p.frame->camera, is_test});
    ++order;
  }
  return views;
}

void write_points(const fs::path& path, const std::vector<Vec3<double>>& points) {
  Tensor<float> array({static_cast<int64_t>(points.size()), 3});
  for (size_t i = 0; i < points.size(); ++i) store3(array.row(static_cast<int64_t>(i)), points[i]);
  write_npy(path, array);
}

}  // namespace

std::vector<Vec3<double>> good_points(const ColmapModel& model) {
  constexpr double largest_error = 2;
  constexpr int64_t fewest_pictures = 3;
  std::vector<Vec3<double>> points;
  for (const ColmapPoint& point : model.points) {
    if (point.error <= largest_error && point.track_length >= fewest_pictures)
      points.push_back(point.position);
  }
  return points;
}

std::string write_capture(const PrepareOptions& options, const CaptureParts& parts, const fs::path& folder,
                          const Work& work) {
  const std::vector<PosedFrame> posed = posed_frames(parts);
  const std::vector<NerfiesView> views = views_of(options, posed);
  const auto tests = std::ranges::count_if(views, [](const NerfiesView& view) { return view.is_test; });
  if (tests == 0 || tests == static_cast<std::ptrdiff_t>(views.size())) {
    throw InputError("COLMAP's model", "poses",
                     fmt::format("{} training and {} test views",
                                 static_cast<std::ptrdiff_t>(views.size()) - tests, tests),
                     "some of both",
                     options.test_video.empty() ? "use a smaller --test-every"
                                                : "see that both films show the same place");
  }
  fs::remove_all(folder);
  for (const char* name : {"camera", "rgb/1x", "rgb/2x", "rgb/4x"}) fs::create_directories(folder / name);
  write_pictures(posed, parts.pictures, folder, work);
  const std::vector<Vec3<double>> points = good_points(parts.model);
  std::vector<Camera<double>> cameras;
  cameras.reserve(posed.size());
  for (const PosedFrame& p : posed) cameras.push_back(p.camera);
  if (options.masks == "estimate") {
    fs::create_directories(folder / "motion_mask/1x");
    write_estimated_masks(posed, typical_depth(points, cameras), folder, work);
  } else if (wants_masks(options)) {
    fs::create_directories(folder / "mask/1x");
    write_given_masks(posed, parts.masks, folder);
  }
  write_points(folder / "points.npy", points);
  const SceneBounds bounds = scene_bounds(points, cameras);
  write_nerfies_layout(folder, views, {bounds.normalisation, bounds.near_plane, bounds.far_plane});
  const double zoom = posed.front().zoom;
  return fmt::format(
      "{} training and {} test views of {}×{}, {} points{}",
      static_cast<std::ptrdiff_t>(views.size()) - tests, tests, posed.front().camera.width,
      posed.front().camera.height, points.size(),
      posed.front().lens.is_pinhole() ? "" : fmt::format(", straightened with a zoom of {:.3f}", zoom));
}

void check_place(const fs::path& capture) {
  if (!fs::exists(capture)) return;
  const auto refuse = [&](const std::string& found) {
    throw InputError(capture.string(), "output folder", found, "a new folder, or a capture that prepare made",
                     "choose another folder, or move what is there away");
  };
  if (!fs::is_directory(capture)) refuse("a file");
  // Replacing it would leave the process in the moved folder.
  if (fs::equivalent(capture, fs::current_path())) refuse("the folder that you are in");
  if (fs::is_empty(capture)) return;
  if (!fs::exists(capture / marker)) refuse("other files in it");
  const std::set<std::string> own(own_names.begin(), own_names.end());
  for (const auto& entry : fs::directory_iterator(capture)) {
    const std::string name = entry.path().filename().string();
    if (!own.contains(name)) refuse(name + ", which prepare did not write");
  }
  if (fs::exists(capture / attached_masks)) refuse("masks that attach-priors put there");
}

void check_movable(const fs::path& capture, const fs::path& trial) {
  // An existing capture is not moved for this test: if the program were killed in between, the capture would
  // be missing.
  if (!fs::is_directory(capture) || !fs::is_empty(capture)) return;
  std::error_code error;
  fs::rename(capture, trial, error);
  if (!error) fs::rename(trial, capture, error);
  if (!error) return;
  throw InputError(capture.string(), "output folder", "one that cannot be moved (" + error.message() + ")",
                   "a new folder, or one that can be replaced as a whole",
                   "where it is a mount point, name a folder below it");
}

void move_into_place(const fs::path& folder, const fs::path& capture, const fs::path& aside) {
  check_place(capture);
  fs::remove_all(aside);
  if (fs::exists(capture)) fs::rename(capture, aside);
  fs::rename(folder, capture);
  fs::remove_all(aside);
}

}  // namespace traceflow::prepare

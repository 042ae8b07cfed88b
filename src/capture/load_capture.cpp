#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <set>

#include "base/parallel.h"
#include "capture/camera_file.h"
#include "capture/capture.h"
#include "capture/decode.h"
#include "capture/image_cache.h"
#include "capture/layout.h"
#include "capture/prior_axes.h"
#include "files/png.h"

namespace traceflow {

namespace {

namespace fs = std::filesystem;

constexpr int largest_downscale = 64;

// rgb/Mx and the factor that is left to filter: M·factor = downscale, M as large as the folder has.
struct ImageFolder {
  int stored = 1;
  int factor = 1;
};

std::string scale_name(int scale) { return std::to_string(scale) + "x"; }

ImageFolder choose_images(const fs::path& folder, int downscale) {
  for (int stored = downscale; stored >= 1; --stored) {
    if (downscale % stored == 0 && fs::is_directory(folder / "rgb" / scale_name(stored))) {
      return {stored, downscale / stored};
    }
  }
  std::string found;
  for (int stored = 1; stored <= largest_downscale; ++stored) {
    if (fs::is_directory(folder / "rgb" / scale_name(stored)))
      found += (found.empty() ? "" : ", ") + scale_name(stored);
  }
  throw InputError((folder / "rgb").string(), "", found.empty() ? "no images" : found,
                   "images at 1x or at a divisor of the downscale (" + std::to_string(downscale) + ")",
                   found.empty() ? "" : "use a --downscale that the folder has");
}

// The first of the candidates that exists, or an empty path.
fs::path first_file(std::initializer_list<fs::path> candidates) {
  for (const fs::path& path : candidates) {
    if (fs::is_regular_file(path)) return path;
  }
  return {};
}

// Reads a capture step by step; each step leaves its results and warnings in `capture` and `sources`.
class Loader {
 public:
  Loader(const fs::path& folder, const CaptureOptions& options) : options_(options) {
    capture_.folder = folder;
    const fs::path whole = fs::weakly_canonical(folder);
    capture_.name = whole.filename().string();
    layout_ = read_layout(whole, capture_.warnings);
    capture_.format = layout_.format;
    capture_.normalisation = layout_.normalisation;
    capture_.near_plane = static_cast<float>(layout_.near_plane);
    capture_.far_plane = static_cast<float>(layout_.far_plane);
    shared_.scale = layout_.normalisation.scale;
    images_ = choose_images(folder, options.downscale);
  }

  Capture load() {
    read_views();
    set_extent();
    read_points();
    find_masks();
    find_priors();
    find_truth();
    choose_axes();
    capture_.images = std::make_shared<ImageCache>(std::move(sources_), std::move(shared_),
                                                   options_.cache_mebibytes * (int64_t{1} << 20));
    return std::move(capture_);
  }

 private:
  void warn(const std::string& text) { capture_.warnings.push_back(text); }

  fs::path image_path(const std::string& id) const {
    return capture_.folder / "rgb" / scale_name(images_.stored) / (id + ".png");
  }

  void read_views() {
    double last = 0;
    for (const auto& [id, time] : layout_.time_id) last = std::max(last, time);
    last_time_ = last > 0 ? last : 1;
    if (!(last > 0)) warn("metadata.json: all views have time 0: the scene cannot move");
    capture_.train = read_split(layout_.train_ids, "training");
    capture_.test = read_split(layout_.test_ids, "test");
    if (capture_.train.empty()) {
      throw InputError(capture_.folder.string(), "training views", "none that is whole",
                       "an image, a camera and a time each",
                       "see what is missing: " + (capture_.warnings.empty() ? "" : capture_.warnings.back()));
    }
    warn_about_sizes();
  }

  std::vector<View> read_split(const std::vector<std::string>& ids, const std::string& name) {
    const auto camera_path = [&](const std::string& id) {
      return capture_.folder / "camera" / (id + ".json");
    };
    const auto whole = keep(
        keep(keep(ids, name, "image", [&](const auto& id) { return fs::is_regular_file(image_path(id)); }),
             name, "camera", [&](const auto& id) { return fs::is_regular_file(camera_path(id)); }),
        name, "entry in metadata.json", [&](const auto& id) { return layout_.time_id.contains(id); });
    std::vector<View> views(whole.size());
    std::vector<ViewSource> sources(whole.size());
    std::vector<std::string> misfits(whole.size());
    parallel_for(
        "capture: cameras", static_cast<int64_t>(whole.size()),
        [&](int64_t n) {
          const auto i = static_cast<size_t>(n);
          const CapturedCamera camera = read_camera(camera_path(whole[i]));
          const PngSize size = read_png_size(image_path(whole[i]));
          sources[i] = source_of(whole[i], camera, size);
          views[i] = view_of(whole[i], camera, sources[i]);
          const double stretch = (size.width / camera.lens.width) / (size.height / camera.lens.height);
          if (std::abs(stretch - 1) > 0.02) misfits[i] = whole[i];
        },
        1);
    std::erase(misfits, "");
    if (!misfits.empty()) {
      warn("image_size of " + ids_text(misfits) +
           " has other proportions than the image: the camera is stretched to it");
    }
    for (size_t i = 0; i < whole.size(); ++i) sources_.emplace(whole[i], std::move(sources[i]));
    return views;
  }

  template <class F>
  std::vector<std::string> keep(const std::vector<std::string>& ids, const std::string& split,
                                const std::string& what, F&& exists) {
    std::vector<std::string> kept, missing;
    for (const std::string& id : ids) (exists(id) ? kept : missing).push_back(id);
    if (!missing.empty()) {
      warn(std::to_string(missing.size()) + " of " + std::to_string(ids.size()) + " " + split +
           " views have no " + what + " (" + ids_text(missing) + "): left out");
    }
    return kept;
  }

  ViewSource source_of(const std::string& id, const CapturedCamera& camera, const PngSize& size) const {
    ViewSource source;
    source.image = image_path(id);
    source.lens = camera.lens.resized(size.width, size.height);
    source.factor = images_.factor;
    if (source.width() < 1 || source.height() < 1) {
      throw InputError(
          source.image.string(), "size", std::to_string(size.width) + "×" + std::to_string(size.height),
          "at least " + std::to_string(images_.factor) + " pixels a side", "use a smaller --downscale");
    }
    if (!source.lens.is_pinhole()) {
      source.zoom = pinhole_zoom(source.lens, (capture_.folder / "camera" / (id + ".json")).string());
    }
    source.camera_from_world = camera.camera_from_world;
    return source;
  }

  View view_of(const std::string& id, const CapturedCamera& captured, const ViewSource& source) const {
    const Lens& lens = source.lens;
    Camera<double> camera;
    camera.width = static_cast<int>(source.width());
    camera.height = static_cast<int>(source.height());
    camera.focal_x = source.zoom * lens.focal.x / source.factor;
    camera.focal_y = source.zoom * lens.focal.y / source.factor;
    camera.centre_x = lens.centre.x / source.factor;
    camera.centre_y = lens.centre.y / source.factor;
    camera.camera_from_world = captured.camera_from_world;
    camera.position = layout_.normalisation.in_scene(captured.position);
    return {id, static_cast<float>(layout_.time_id.at(id) / last_time_), convert<float>(camera)};
  }

  void warn_about_sizes() {
    std::set<std::pair<int, int>> sizes;
    for (const auto* split : {&capture_.train, &capture_.test}) {
      for (const View& view : *split) sizes.insert({view.camera.width, view.camera.height});
    }
    if (sizes.size() > 1) {
      warn("the views have " + std::to_string(sizes.size()) + " different sizes, from " +
           std::to_string(sizes.begin()->first) + "×" + std::to_string(sizes.begin()->second) + " to " +
           std::to_string(sizes.rbegin()->first) + "×" + std::to_string(sizes.rbegin()->second));
    }
  }

  void set_extent() {
    Vec3<double> mean(0);
    for (const View& view : capture_.train) {
      mean += Vec3<double>(view.camera.position) / static_cast<double>(capture_.train.size());
    }
    double farthest = 0;
    for (const View& view : capture_.train) {
      farthest = std::max(farthest, length(Vec3<double>(view.camera.position) - mean));
    }
    if (farthest > 0) {
      capture_.extent = static_cast<float>(1.1 * farthest);
    } else {
      warn(
          "all training cameras stand at one place: the scene's extent is taken as 1, and depth cannot be "
          "learned");
    }
  }

  void read_points() {
    const fs::path path = capture_.folder / "points.npy";
    if (!fs::exists(path)) return warn("points.npy is missing: surfels start at random");
    const Tensor<float> raw = read_npy(path);
    if (raw.shape().rank() != 2 || raw.dim(1) != 3) {
      throw InputError(path.string(), "shape", raw.shape().to_string(), "P×3");
    }
    std::vector<float> kept;
    kept.reserve(static_cast<size_t>(raw.size()));
    for (int64_t i = 0; i < raw.dim(0); ++i) {
      const Vec3<float> x(layout_.normalisation.in_scene(load3<double>(raw.row(i))));
      if (!std::isfinite(x.x) || !std::isfinite(x.y) || !std::isfinite(x.z)) continue;
      kept.insert(kept.end(), {x.x, x.y, x.z});
    }
    const auto count = static_cast<int64_t>(kept.size() / 3);
    capture_.points = Tensor<float>({count, 3});
    std::copy(kept.begin(), kept.end(), capture_.points.data());
    if (count < raw.dim(0)) {
      warn("points.npy: " + std::to_string(raw.dim(0) - count) + " of " + std::to_string(raw.dim(0)) +
           " points are not finite: left out");
    }
    if (count > 0 && share_seen() < 0.1) {
      warn("points.npy: hardly any point falls into an image; is it in the capture's own coordinates?");
    }
  }

  // The share of the points that fall into some training image.
  double share_seen() const {
    const int64_t step = std::max<int64_t>(1, capture_.points.dim(0) / 1000);
    int64_t seen = 0, count = 0;
    for (int64_t i = 0; i < capture_.points.dim(0); i += step, ++count) {
      seen += std::any_of(capture_.train.begin(), capture_.train.end(), [&](const View& view) {
        const Vec3<float> x = view.camera.point_in_camera(load3<float>(capture_.points.row(i)));
        if (!(x.z > 0)) return false;
        const Vec2<float> at = view.camera.project(x);
        return at.x >= 0 && at.y >= 0 && at.x < static_cast<float>(view.camera.width) &&
               at.y < static_cast<float>(view.camera.height);
      });
    }
    return static_cast<double>(seen) / static_cast<double>(count);
  }

  // Ids of the split's views whose source lacks something.
  template <class F>
  static std::vector<std::string> ids_without(const std::vector<View>& views,
                                              const std::unordered_map<std::string, ViewSource>& sources,
                                              F&& has) {
    std::vector<std::string> ids;
    for (const View& view : views) {
      if (!has(sources.at(view.id))) ids.push_back(view.id);
    }
    return ids;
  }

  void warn_if_partial(const std::vector<View>& views, const std::vector<std::string>& missing,
                       const std::string& what) {
    if (missing.empty() || missing.size() == views.size()) return;
    warn(std::to_string(missing.size()) + " of " + std::to_string(views.size()) + " " + what + " (" +
         ids_text(missing) + ")");
  }

  void find_masks() {
    const fs::path& folder = capture_.folder;
    const std::string scale = scale_name(images_.stored);
    for (auto& [id, source] : sources_) {
      const std::string twice = id + ".png.png", once = id + ".png";
      source.mask = first_file({folder / "mask" / scale / twice, folder / "mask" / scale / once,
                                folder / "mask/1x" / twice, folder / "mask/1x" / once});
      if (source.mask.empty()) {
        source.mask =
            first_file({folder / "resized_mask" / scale / twice, folder / "resized_mask" / scale / once,
                        folder / "resized_mask/1x" / twice, folder / "resized_mask/1x" / once});
        source.mask_is_inverted = !source.mask.empty();
      }
      capture_.has_masks |= !source.mask.empty();
    }
    const auto has = [](const ViewSource& source) { return !source.mask.empty(); };
    warn_if_partial(capture_.train, ids_without(capture_.train, sources_, has),
                    "training views have no mask");
    warn_if_partial(capture_.test, ids_without(capture_.test, sources_, has), "test views have no mask");
    warn_about_proportions("mask", [](const ViewSource& source) { return source.mask; });
  }

  void find_priors() {
    const fs::path& folder = capture_.folder;
    const std::string scale = scale_name(images_.stored);
    for (auto& [id, source] : sources_) {
      source.prior =
          first_file({folder / "normal" / scale / (id + ".png"), folder / "normal/1x" / (id + ".png")});
      capture_.has_normal_priors |= !source.prior.empty();
    }
    const fs::path array = first_file({folder / "normal.npz", folder / "normal.npy"});
    if (!capture_.has_normal_priors && !array.empty()) take_prior_array(array);
    if (!capture_.has_normal_priors) return;
    const auto has = [](const ViewSource& source) { return source.has_prior(); };
    warn_if_partial(capture_.train, ids_without(capture_.train, sources_, has),
                    "training views have no normal prior");
    warn_about_proportions("normal prior", [](const ViewSource& source) { return source.prior; });
  }

  // One element for each training id in the order of dataset.json, or one for each of all ids.
  void take_prior_array(const fs::path& path) {
    shared_.prior_array.emplace(path);
    const Shape& shape = shared_.prior_array->shape();
    const bool fits_train = shape.rank() == 4 && shape[0] == static_cast<int64_t>(layout_.train_ids.size());
    const bool fits_all = shape.rank() == 4 && shape[0] == static_cast<int64_t>(layout_.all_ids.size());
    if ((!fits_train && !fits_all) || shape[3] != 3 || shape.elements() == 0) {
      throw InputError(path.string(), "shape", shape.to_string(),
                       "T×H×W×3 with T the training views (" + std::to_string(layout_.train_ids.size()) +
                           ") or all (" + std::to_string(layout_.all_ids.size()) + ")",
                       "make the priors again or take the file away");
    }
    const std::vector<std::string>& ids = fits_train ? layout_.train_ids : layout_.all_ids;
    for (size_t i = 0; i < ids.size(); ++i) {
      const auto found = sources_.find(ids[i]);
      if (found != sources_.end()) found->second.prior_slice = static_cast<int64_t>(i);
    }
    capture_.has_normal_priors = true;
  }

  // Reads the header of every file that `path_of` names; a file that is no PNG ends the loading here, not in
  // the middle of a run.
  template <class F>
  void warn_about_proportions(const std::string& what, F&& path_of) {
    std::vector<std::string> misfits;
    for (const auto* split : {&capture_.train, &capture_.test}) {
      for (const View& view : *split) {
        const ViewSource& source = sources_.at(view.id);
        if (path_of(source).empty()) continue;
        const PngSize size = read_png_size(path_of(source));
        const double stretch = (size.width / source.lens.width) / (size.height / source.lens.height);
        if (std::abs(stretch - 1) > 0.02) misfits.push_back(view.id);
      }
    }
    if (!misfits.empty()) {
      warn("the " + what + " of " + ids_text(misfits) +
           " has other proportions than the image: stretched to it");
    }
  }

  void find_truth() {
    for (auto& [id, source] : sources_) {
      source.truth_normal = first_file({capture_.folder / "truth/normal" / (id + ".png")});
      source.truth_depth = first_file({capture_.folder / "truth/depth" / (id + ".npy")});
    }
    for (const View& view : capture_.test) {
      const ViewSource& source = sources_.at(view.id);
      capture_.has_truth |= !source.truth_normal.empty() || !source.truth_depth.empty();
    }
  }

  // Views near time 0, when the points were there.
  void choose_axes() {
    constexpr size_t views_to_check = 6;
    if (capture_.has_normal_priors) {
      std::vector<const View*> views;
      for (const View& view : capture_.train) {
        if (sources_.at(view.id).has_prior()) views.push_back(&view);
      }
      std::stable_sort(views.begin(), views.end(),
                       [](const View* a, const View* b) { return a->time < b->time; });
      views.resize(std::min(views.size(), views_to_check));
      std::vector<PriorView> priors(views.size());
      parallel_for(
          "capture: prior axes", static_cast<int64_t>(views.size()),
          [&](int64_t n) {
            const auto i = static_cast<size_t>(n);
            priors[i] = {views[i]->camera, decode_prior(sources_.at(views[i]->id), shared_)};
          },
          1);
      const AxisChoice choice =
          choose_prior_axes(options_.prior_axes, measure_prior_axes(capture_.points, priors));
      capture_.prior_axes = choice.axes;
      if (!choice.warning.empty()) warn(choice.warning);
    }
    shared_.prior_signs = prior_axis_signs(capture_.prior_axes);
  }

  const CaptureOptions options_;
  Capture capture_;
  CaptureLayout layout_;
  ImageFolder images_;
  CaptureSource shared_;
  std::unordered_map<std::string, ViewSource> sources_;
  double last_time_ = 1;
};

}  // namespace

void CaptureOptions::validate() const {
  check_option(downscale >= 1 && downscale <= largest_downscale, "downscale", downscale, "1 to 64");
  check_option(cache_mebibytes >= 0 && cache_mebibytes <= (int64_t{1} << 30), "cache_mebibytes",
               cache_mebibytes, "0 to 2^30");
}

Capture load_capture(const std::filesystem::path& folder, const CaptureOptions& options) {
  options.validate();
  if (!fs::is_directory(folder)) {
    throw InputError(folder.string(), "", fs::exists(folder) ? "a file" : "nothing", "a capture's folder");
  }
  return Loader(folder, options).load();
}

}  // namespace traceflow

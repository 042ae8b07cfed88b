#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <unordered_map>

#include "base/error.h"
#include "base/parallel.h"
#include "base/printable.h"
#include "capture/capture.h"
#include "capture/decode.h"
#include "capture/extent.h"
#include "capture/formats/formats.h"
#include "capture/image_cache.h"
#include "capture/prior_axes.h"
#include "files/image.h"
#include "files/limits.h"

namespace traceflow {

namespace {

bool differs_in_proportions(const Vec2<double>& size, const Lens& lens) {
  return !same_proportions(size.x, size.y, lens.width, lens.height);
}

Vec2<double> size_of(const TreeFile& image) {
  const ImageSize size = read_image_size(image.open());
  return {size.width, size.height};
}

uint8_t grey_level(Background background) {
  return background == Background::white ? 255 : background == Background::grey ? 128 : 0;
}

// Makes views of what a reader found. Each step stores its results and warnings in `capture_` and `sources_`.
class Assembly {
 public:
  Assembly(const std::filesystem::path& path, const CaptureOptions& options)
      : options_(options), tree_(FileTree::open(path)), found_(read_capture(tree_, options)) {
    capture_.folder = path;
    const std::filesystem::path whole = std::filesystem::weakly_canonical(path);
    capture_.name = (std::filesystem::is_directory(path) ? whole.filename() : whole.stem()).string();
    capture_.format = found_.format;
    capture_.normalisation = found_.normalisation;
    capture_.near_plane = static_cast<float>(found_.near_plane);
    capture_.far_plane = static_cast<float>(found_.far_plane);
    capture_.warnings = std::move(found_.warnings);
    shared_.scale = found_.normalisation.scale;
    background_ =
        grey_level(options.background == Background::automatic ? found_.background : options.background);
    transparent_is_unknown_ = found_.transparent_is_unknown && options.background == Background::automatic;
  }

  Capture finish() {
    make_views();
    set_extent();
    take_points();
    find_masks();
    find_priors();
    find_depths();
    find_tracks();
    find_truth();
    choose_axes();
    // Warnings quote names from files.
    for (Finding& warning : capture_.warnings) warning.text = printable(warning.text, 1000);
    capture_.images = std::make_shared<ImageCache>(std::move(sources_), std::move(shared_),
                                                   options_.cache_mebibytes * (int64_t{1} << 20));
    return std::move(capture_);
  }

 private:
  Finding& warn(const std::string& text, const std::string& kind, Severity severity = Severity::problem) {
    return capture_.warnings.emplace_back(text, kind, severity);
  }

  // The first candidate that exists, or none.
  TreeFile first_file(std::initializer_list<std::string> candidates) const {
    for (const std::string& path : candidates) {
      if (tree_->has(path)) return {tree_, path};
    }
    return {};
  }

  void make_views() {
    if (found_.train.empty()) {
      const auto missing = std::ranges::find_if(
          capture_.warnings, [](const Finding& f) { return f.kind.starts_with("missing-"); });
      if (missing == capture_.warnings.end()) {
        throw InputError(capture_.folder.string(), "training views",
                         "none, and " + std::to_string(found_.test.size()) + " test views", "at least one",
                         "--test-every 0 trains on all views where the capture does not split them");
      }
      throw InputError(capture_.folder.string(), "training views", "no complete view",
                       "an image, a camera and a time each", "see what is missing: " + missing->text);
    }
    stretch_times();
    capture_.train = make_split(found_.train);
    capture_.test = make_split(found_.test);
    warn_about_times();
    warn_about_sizes();
  }

  // Scales times so that the first view has 0 and the last has 1.
  void stretch_times() {
    double first = found_.train.front().time, last = first;
    for (const auto* split : {&found_.train, &found_.test}) {
      for (const FoundView& view : *split) {
        first = std::min(first, view.time);
        last = std::max(last, view.time);
      }
    }
    const double span = last > first ? last - first : 1;
    for (auto* split : {&found_.train, &found_.test}) {
      for (FoundView& view : *split) view.time = (view.time - first) / span;
    }
  }

  void warn_about_times() {
    const bool moves = std::ranges::any_of(
        capture_.train, [&](const View& view) { return view.time != capture_.train.front().time; });
    if (moves) return;
    warn("all training views are of one time: the scene cannot move", "one-time",
         found_.times == CaptureTimes::none ? Severity::notice : Severity::problem);
  }

  std::vector<View> make_split(const std::vector<FoundView>& found) {
    std::vector<View> views(found.size());
    std::vector<ViewSource> sources(found.size());
    std::vector<std::string> misfits(found.size()), turned(found.size());
    parallel_for(
        "capture: cameras", static_cast<int64_t>(found.size()),
        [&](int64_t n) {
          const auto i = static_cast<size_t>(n);
          const ImageSize size = read_image_size(found[i].image.open());
          sources[i] = source_of(found[i], size);
          views[i] = view_of(found[i], sources[i]);
          if (differs_in_proportions({size.width, size.height}, found[i].lens)) misfits[i] = found[i].id;
          if (size.orientation != 1) turned[i] = found[i].id;
        },
        1);
    std::erase(misfits, "");
    if (!misfits.empty()) {
      warn("image_size of " + ids_text(misfits) +
               " has other proportions than the image: the camera is stretched to it",
           "camera-size")
          .views = misfits;
    }
    std::erase(turned, "");
    if (!turned.empty()) {
      warn("viewers turn the images of " + ids_text(turned) +
               " (EXIF orientation): taken as stored, to which cameras refer",
           "turned-image", Severity::notice)
          .views = turned;
    }
    for (size_t i = 0; i < found.size(); ++i) sources_.emplace(found[i].id, std::move(sources[i]));
    return views;
  }

  ViewSource source_of(const FoundView& found, const ImageSize& size) const {
    ViewSource source;
    source.image = found.image;
    source.lens = found.lens.resized(size.width, size.height);
    source.factor = found_.images.factor;
    if (source.width() < 1 || source.height() < 1) {
      throw InputError(
          source.image.name(), "size", std::to_string(size.width) + "×" + std::to_string(size.height),
          "at least " + std::to_string(source.factor) + " pixels a side", "use a smaller --downscale");
    }
    if (!source.lens.is_pinhole()) source.zoom = pinhole_zoom(source.lens, found.camera_name);
    source.camera_from_world = found.camera_from_world;
    source.background = background_;
    source.transparent_is_unknown = transparent_is_unknown_;
    source.rig_camera = found.rig_camera;
    return source;
  }

  View view_of(const FoundView& found, const ViewSource& source) const {
    const Lens& lens = source.lens;
    Camera<double> camera;
    camera.width = static_cast<int>(source.width());
    camera.height = static_cast<int>(source.height());
    camera.focal_x = source.zoom * lens.focal.x / source.factor;
    camera.focal_y = source.zoom * lens.focal.y / source.factor;
    camera.centre_x = lens.centre.x / source.factor;
    camera.centre_y = lens.centre.y / source.factor;
    camera.camera_from_world = found.camera_from_world;
    camera.position = found_.normalisation.in_scene(found.position);
    check_position(found, camera.position);
    return {found.id, static_cast<float>(found.time), convert<float>(camera)};
  }

  // Checks that single precision can hold the position, with some margin for arithmetic.
  static void check_position(const FoundView& found, const Vec3<double>& in_scene) {
    constexpr double farthest = 1e15;
    const double distance = length(in_scene);
    // Also true for NaN.
    if (!(distance < farthest)) {
      throw InputError(found.camera_name, "position",
                       fmt::format("{:g} scene units from the scene's centre", distance),
                       fmt::format("less than {:g}", farthest));
    }
  }

  void warn_about_sizes() {
    std::set<std::pair<int, int>> sizes;
    for (const auto* split : {&capture_.train, &capture_.test}) {
      for (const View& view : *split) sizes.insert({view.camera.width, view.camera.height});
    }
    if (sizes.size() > 1) {
      warn("the views have " + std::to_string(sizes.size()) + " different sizes, from " +
               std::to_string(sizes.begin()->first) + "×" + std::to_string(sizes.begin()->second) + " to " +
               std::to_string(sizes.rbegin()->first) + "×" + std::to_string(sizes.rbegin()->second),
           "mixed-sizes", Severity::notice);
    }
  }

  void set_extent() {
    std::vector<Vec3<double>> positions;
    for (const View& view : capture_.train) positions.emplace_back(view.camera.position);
    const double extent = camera_extent(positions);
    if (extent > 0) {
      capture_.extent = static_cast<float>(extent);
    } else {
      warn(
          "all training cameras stand at one place: the scene's extent is taken as 1, and depth cannot be "
          "learned",
          "one-place");
    }
  }

  void take_points() {
    if (found_.points_file.empty()) {
      warn("there are no points: surfels start at random", "no-points", Severity::notice);
      return;
    }
    std::vector<float> kept;
    kept.reserve(3 * found_.points.size());
    for (const Vec3<double>& point : found_.points) {
      const Vec3<float> x(found_.normalisation.in_scene(point));
      if (!std::isfinite(x.x) || !std::isfinite(x.y) || !std::isfinite(x.z)) continue;
      kept.insert(kept.end(), {x.x, x.y, x.z});
    }
    const size_t count = kept.size() / 3, all = found_.points.size();
    capture_.points = Tensor<float>({static_cast<int64_t>(count), 3});
    std::ranges::copy(kept, capture_.points.data());
    if (count < all) {
      warn(found_.points_file + ": " + std::to_string(all - count) + " of " + std::to_string(all) +
               " points are not finite: left out",
           "points-not-finite");
    }
    if (count > 0 && share_seen() < 0.1) {
      warn(found_.points_file +
               ": hardly any point falls into an image; is it in the capture's own coordinates?",
           "points-unseen");
    }
  }

  // The fraction of the points that project into any training image.
  double share_seen() const {
    const int64_t step = std::max<int64_t>(1, capture_.points.dim(0) / 1000);
    int64_t seen = 0, count = 0;
    for (int64_t i = 0; i < capture_.points.dim(0); i += step, ++count) {
      const Vec3<float> point = load3<float>(capture_.points.row(i));
      seen += std::ranges::any_of(capture_.train, [&](const View& view) { return view.camera.sees(point); });
    }
    return static_cast<double>(seen) / static_cast<double>(count);
  }

  // The ids of the views whose source fails `has`.
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
                       const std::string& what, const std::string& kind) {
    if (missing.empty() || missing.size() == views.size()) return;
    warn(std::to_string(missing.size()) + " of " + std::to_string(views.size()) + " " + what + " (" +
             ids_text(missing) + ")",
         kind)
        .views = missing;
  }

  void find_masks() {
    const std::string scale = std::to_string(found_.images.stored) + "x";
    const auto in = [&](const std::string& folder, const std::string& id) {
      const std::string twice = "/" + id + ".png.png", once = "/" + id + ".png";
      return first_file({folder + "/" + scale + twice, folder + "/" + scale + once, folder + "/1x" + twice,
                         folder + "/1x" + once});
    };
    for (auto& [id, source] : sources_) {
      source.mask = in("mask", id);
      if (!source.mask) {
        source.mask = in("resized_mask", id);
        source.mask_is_inverted = static_cast<bool>(source.mask);
      }
      capture_.has_masks |= static_cast<bool>(source.mask);
    }
    // All views use one kind of mask: metrics must not mix two kinds.
    if (!capture_.has_masks) {
      for (auto& [id, source] : sources_) {
        source.mask = in("motion_mask", id);
        capture_.has_masks |= static_cast<bool>(source.mask);
      }
      capture_.masks_are_estimated = capture_.has_masks;
    }
    const auto has = [](const ViewSource& source) { return static_cast<bool>(source.mask); };
    warn_if_partial(capture_.train, ids_without(capture_.train, sources_, has), "training views have no mask",
                    "missing-mask");
    warn_if_partial(capture_.test, ids_without(capture_.test, sources_, has), "test views have no mask",
                    "missing-mask");
    warn_about_proportions("mask", "mask-size", [](const ViewSource& source) {
      return source.mask ? std::optional(size_of(source.mask)) : std::nullopt;
    });
  }

  void find_priors() {
    const std::string scale = std::to_string(found_.images.stored) + "x";
    for (auto& [id, source] : sources_) {
      source.prior = first_file({"normal/" + scale + "/" + id + ".png", "normal/1x/" + id + ".png"});
      capture_.has_normal_priors |= static_cast<bool>(source.prior);
    }
    const TreeFile array = first_file({"normal.npz", "normal.npy"});
    if (!capture_.has_normal_priors && array) take_prior_array(array);
    if (!capture_.has_normal_priors) return;
    const auto has = [](const ViewSource& source) { return source.has_prior(); };
    warn_if_partial(capture_.train, ids_without(capture_.train, sources_, has),
                    "training views have no normal prior", "missing-prior");
    warn_about_proportions(
        "normal prior", "prior-size", [&](const ViewSource& source) -> std::optional<Vec2<double>> {
          if (source.prior) return size_of(source.prior);
          if (source.prior_slice < 0) return std::nullopt;
          const Shape& shape = shared_.prior_array->shape();
          return Vec2<double>(static_cast<double>(shape[2]), static_cast<double>(shape[1]));
        });
  }

  // The ids that the elements of an array belong to: training ids in the capture's order, or all ids. Null if
  // the array fits neither.
  const std::vector<std::string>* ids_of_rows(const Shape& shape) const {
    for (const auto* ids : {&found_.train_ids, &found_.all_ids}) {
      if (shape.rank() > 0 && shape[0] == static_cast<int64_t>(ids->size())) return ids;
    }
    return nullptr;
  }
  std::string meaning_of_rows() const {
    return "T the training views (" + std::to_string(found_.train_ids.size()) + ") or all (" +
           std::to_string(found_.all_ids.size()) + ")";
  }

  void take_prior_array(const TreeFile& file) {
    shared_.prior_array.emplace(file.open());
    const Shape& shape = shared_.prior_array->shape();
    const std::vector<std::string>* const ids = ids_of_rows(shape);
    if (ids == nullptr || shape.rank() != 4 || shape[3] != 3 || shape.elements() == 0) {
      throw InputError(file.name(), "shape", shape.to_string(), "T×H×W×3 with " + meaning_of_rows(),
                       "make the priors again or take the file away");
    }
    if (!is_image_size(shape[2], shape[1]))
      throw InputError(file.name(), "shape", shape.to_string(), image_size_limits, "scale the priors down");
    for (size_t i = 0; i < ids->size(); ++i) {
      const auto found = sources_.find((*ids)[i]);
      if (found != sources_.end()) found->second.prior_slice = static_cast<int64_t>(i);
    }
    capture_.has_normal_priors = true;
  }

  void find_depths() {
    const std::string scale = std::to_string(found_.images.stored) + "x";
    for (auto& [id, source] : sources_) {
      source.depth = first_file({"depth/" + scale + "/" + id + ".npy", "depth/1x/" + id + ".npy"});
      capture_.has_depth_priors |= static_cast<bool>(source.depth);
    }
    const auto has = [](const ViewSource& source) { return static_cast<bool>(source.depth); };
    warn_if_partial(capture_.train, ids_without(capture_.train, sources_, has),
                    "training views have no depth prior", "missing-prior");
    warn_about_proportions("depth prior", "prior-size", [](const ViewSource& source) {
      return source.depth ? std::optional(depth_size(source.depth)) : std::nullopt;
    });
  }

  void find_tracks() {
    const TreeFile file = first_file({"tracks.npy"});
    if (!file) return;
    const NpyFile array(file.open());
    const Shape& shape = array.shape();
    const std::vector<std::string>* const ids = ids_of_rows(shape);
    if (ids == nullptr || shape.rank() != 3 || shape[2] != 3) {
      throw InputError(file.name(), "shape", shape.to_string(), "T×N×3 with " + meaning_of_rows(),
                       "attach the tracks again or take the file away");
    }
    std::unordered_map<std::string, int64_t> row_of;
    for (size_t i = 0; i < ids->size(); ++i) row_of.emplace((*ids)[i], static_cast<int64_t>(i));
    std::vector<TrackRow> rows;
    for (const View& view : capture_.train) {
      const auto row = row_of.find(view.id);
      rows.push_back({row == row_of.end() ? -1 : row->second, &sources_.at(view.id)});
    }
    capture_.tracks = tracks_of_rows(array.read(), rows);
  }

  // size_of_its: width and height of the view's file of this kind, if it has one. It reads the header of
  // every file, so an invalid image fails during loading and not later.
  template <class F>
  void warn_about_proportions(const std::string& what, const std::string& kind, F&& size_of_its) {
    std::vector<std::string> misfits;
    for (const auto* split : {&capture_.train, &capture_.test}) {
      for (const View& view : *split) {
        const ViewSource& source = sources_.at(view.id);
        const std::optional<Vec2<double>> size = size_of_its(source);
        if (size && differs_in_proportions(*size, source.lens)) misfits.push_back(view.id);
      }
    }
    if (!misfits.empty()) {
      warn("the " + what + " of " + ids_text(misfits) +
               " has other proportions than the image: stretched to it",
           kind)
          .views = misfits;
    }
  }

  void find_truth() {
    for (auto& [id, source] : sources_) {
      source.truth_normal = first_file({"truth/normal/" + id + ".png"});
      source.truth_depth = first_file({"truth/depth/" + id + ".npy"});
    }
    for (const View& view : capture_.test) {
      const ViewSource& source = sources_.at(view.id);
      capture_.has_truth |= source.truth_normal || source.truth_depth;
    }
    shared_.motion_points = first_file({"truth/motion/points.npy"});
    shared_.motion_objects = first_file({"truth/motion/object.npy"});
  }

  void choose_axes() {
    if (capture_.has_normal_priors) {
      std::vector<const View*> views;
      for (const View& view : capture_.train) {
        if (sources_.at(view.id).has_prior()) views.push_back(&view);
      }
      views = views_for_axes(std::move(views));
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
      if (!choice.warning.empty()) warn(choice.warning, "prior-axes");
    }
    shared_.prior_signs = prior_axis_signs(capture_.prior_axes);
  }

  const CaptureOptions options_;
  const std::shared_ptr<const FileTree> tree_;
  FoundCapture found_;
  Capture capture_;
  CaptureSource shared_;
  std::unordered_map<std::string, ViewSource> sources_;
  uint8_t background_ = 0;
  bool transparent_is_unknown_ = false;
};

}  // namespace

Capture load_capture(const std::filesystem::path& path, const CaptureOptions& options) {
  options.validate();
  return Assembly(path, options).finish();
}

std::vector<float> times_of(const Capture& capture) {
  std::set<float> times;
  for (const std::vector<View>* views : {&capture.train, &capture.test}) {
    for (const View& view : *views) times.insert(view.time);
  }
  return {times.begin(), times.end()};
}

}  // namespace traceflow

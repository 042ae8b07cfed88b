#include "prepare/attach_priors.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <set>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/folder_lock.h"
#include "base/work.h"
#include "capture/decode.h"
#include "capture/formats/formats.h"
#include "capture/image_cache.h"
#include "capture/surface_points.h"
#include "files/png.h"
#include "prepare/capture_folder.h"
#include "prepare/depth_fit.h"
#include "prepare/depth_source.h"
#include "prepare/mask_coding.h"
#include "prepare/masks.h"
#include "prepare/normal_source.h"
#include "prepare/programs.h"
#include "prepare/track_source.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;
using Say = std::function<void(const std::string& line)>;

// One kind of data: the new folder or file, and the existing ones that a reader would use together with it or
// before it.
struct Kind {
  const char* name;
  std::vector<const char*> replaced;
};
const std::array<Kind, 4> kinds = {{{"normal", {"normal", "normal.npz", "normal.npy"}},
                                    {"mask", {"mask", "resized_mask"}},
                                    {"tracks.npy", {"tracks.npy"}},
                                    {"depth", {"depth"}}}};
const Kind &normals_kind = kinds[0], &masks_kind = kinds[1], &tracks_kind = kinds[2], &depth_kind = kinds[3];

// Holds new data until it is complete.
class Staging {
 public:
  explicit Staging(const fs::path& capture) : capture_(capture), folder_(capture / ".attach-priors") {
    // An earlier process may have been killed after it moved the old data away and before it moved the new
    // data in.
    for (const Kind& kind : kinds) {
      if (fs::exists(folder_ / kind.name)) put_back(kind);
    }
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~Staging() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  fs::path operator/(const fs::path& name) const { return folder_ / name; }
  // Replaces the capture's data with the new data: all of it, or none.
  void move_in() const {
    std::vector<const Kind*> moved;
    try {
      for (const Kind& kind : kinds) {
        if (!fs::exists(folder_ / kind.name)) continue;
        moved.push_back(&kind);
        for (const char* name : kind.replaced) {
          if (fs::exists(capture_ / name)) fs::rename(capture_ / name, old(name));
        }
        fs::rename(folder_ / kind.name, capture_ / kind.name);
      }
    } catch (const fs::filesystem_error&) {
      for (const Kind* kind : moved) {
        if (!fs::exists(folder_ / kind->name)) fs::rename(capture_ / kind->name, folder_ / kind->name);
        put_back(*kind);
      }
      throw;
    }
  }

 private:
  fs::path old(const std::string& name) const { return folder_ / ("old " + name); }
  void put_back(const Kind& kind) const {
    for (const char* name : kind.replaced) {
      if (fs::exists(old(name)) && !fs::exists(capture_ / name)) fs::rename(old(name), capture_ / name);
    }
  }

  fs::path capture_, folder_;
};

void refuse_to_replace(const fs::path& capture, const Kind& kind, const AttachOptions& options) {
  for (const char* name : kind.replaced) {
    if (fs::exists(capture / name) && !options.force) {
      throw InputError((capture / name).string(), "", "something there already", "a capture without",
                       "add --force to replace it");
    }
  }
}

std::vector<std::string> ids_of(const std::vector<View>& views) {
  std::vector<std::string> ids;
  ids.reserve(views.size());
  for (const View& view : views) ids.push_back(view.id);
  return ids;
}

ViewIds ids_in(const Capture& capture, const CaptureOptions& options) {
  const FoundCapture found = read_capture(FileTree::open(capture.folder), options);
  ViewIds ids{ids_of(capture.train), {}, found.train_ids, found.all_ids};
  std::set<std::string> there(ids.train.begin(), ids.train.end());
  for (const View& view : capture.test) there.insert(view.id);
  std::ranges::copy_if(found.all_ids, std::back_inserter(ids.all),
                       [&](const std::string& id) { return there.contains(id); });
  return ids;
}

// The views that so many images in order belong to; null if there is no such number of views.
const std::vector<std::string>* views_of_count(const ViewIds& ids, int64_t count) {
  for (const auto* list : {&ids.train, &ids.all, &ids.listed_train, &ids.listed}) {
    if (count == static_cast<int64_t>(list->size())) return list;
  }
  return nullptr;
}

// The requested data does not depend on the size, and some captures only have smaller images.
CaptureOptions at_largest_size(const fs::path& capture) {
  CaptureOptions options;
  const auto is_there = [&] {
    return fs::is_directory(capture / "rgb" / (std::to_string(options.downscale) + "x"));
  };
  constexpr int most = 64;
  while (options.downscale < most && !is_there()) ++options.downscale;
  if (!is_there()) options.downscale = 1;
  return options;
}

// Calls f(id, data of this view), in the order of the source.
template <class Source, class F>
void for_each_view(const std::map<std::string, int64_t>& matched, Source&& take, F&& f) {
  std::map<int64_t, std::string> by_index;
  for (const auto& [id, index] : matched) by_index.emplace(index, id);
  std::vector<int64_t> indices;
  indices.reserve(by_index.size());
  for (const auto& [index, id] : by_index) indices.push_back(index);
  take(indices,
       [&](int64_t place, auto&& value) { f(by_index.at(indices[static_cast<size_t>(place)]), value); });
}

AxisEvidence measure(const Capture& capture, const NormalSource& source,
                     const std::map<std::string, int64_t>& matched, const Staging& staging) {
  std::vector<const View*> views;
  for (const View& view : capture.train) {
    if (matched.contains(view.id)) views.push_back(&view);
  }
  views = views_for_axes(std::move(views));
  std::map<std::string, int64_t> some;
  for (const View* view : views) some.emplace(view->id, matched.at(view->id));
  fs::create_directories(staging / "probe");
  for_each_view(
      some, [&](const auto& indices, const auto& f) { source.take(indices, f); },
      [&](const std::string& id, const Tensor<float>& normals) {
        write_png(staging / "probe" / (id + ".png"), normal_picture(normals));
      });
  const auto tree = FileTree::open(staging / "probe");
  std::vector<PriorView> priors;
  for (const View* view : views) {
    ViewSource with_prior = capture.images->source(view->id);
    with_prior.prior = {tree, view->id + ".png"};
    with_prior.prior_slice = -1;
    priors.push_back({view->camera, decode_prior(with_prior, capture.images->capture())});
  }
  return measure_prior_axes(capture.points, priors);
}

void attach_normals(const Capture& capture, const ViewIds& ids, const AttachOptions& options,
                    const Staging& staging, const Say& say, const std::atomic<bool>& stop) {
  const NormalSource source(options.normals, staging / "ffmpeg.log", stop);
  const auto matched = match_views(options.normals, source.names(), source.count(), ids);
  const FoundAxes axes = find_axes(options.axes, measure(capture, source, matched, staging), options.normals);
  say(fmt::format("{:<10}{} of {} views", "normals", matched.size(),
                  capture.train.size() + capture.test.size()));
  say(fmt::format("{:<10}{}", "axes", axes.text));
  const Vec3<float> written(axes.signs * prior_axis_signs(PriorAxes::opengl));
  fs::create_directories(staging / "normal/1x");
  for_each_view(
      matched, [&](const auto& indices, const auto& f) { source.take(indices, f); },
      [&](const std::string& id, Tensor<float>& normals) {
        if (stop) throw Stopped{};
        for (int64_t i = 0; i < normals.size(); i += 3)
          store3(&normals[i], written * load3<float>(&normals[i]));
        write_png(staging / "normal/1x" / (id + ".png"), normal_picture(normals));
      });
}

void attach_masks(const Capture& capture, const ViewIds& ids, const AttachOptions& options,
                  const Staging& staging, const Say& say, const std::atomic<bool>& stop) {
  const PictureSource source(options.masks, 0, staging / "ffmpeg.log", stop);
  const auto matched = match_views(options.masks, source.names(), source.count(), ids);
  std::map<std::string, Camera<float>> cameras;
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split) cameras.emplace(view.id, view.camera);
  }
  fs::create_directories(staging / "mask/1x");
  double covered = 0;
  std::string assumed;
  for_each_view(
      matched,
      [&](const auto& indices, const auto& f) {
        assumed = take_masks(source, options.masks, options.mask_white, indices, f);
      },
      [&](const std::string& id, const Tensor<uint8_t>& mask) {
        const Camera<float>& camera = cameras.at(id);
        require_proportions(options.masks, "masks", {mask.dim(1), mask.dim(0)}, id, camera.width,
                            camera.height);
        covered += share_of(mask) / static_cast<double>(matched.size());
        write_mask(staging / "mask/1x" / (id + ".png.png"), mask);
      });
  require_white(options.masks, covered);
  write_atomically(staging / attached_masks, "by traceflow attach-priors\n");
  say(fmt::format("{:<10}{} of {} views, covering {:.1f}% of the pixels ({})", "masks", matched.size(),
                  capture.train.size() + capture.test.size(), 100 * covered, assumed));
}

void attach_tracks(const Capture& capture, const ViewIds& ids, const AttachOptions& options,
                   const Staging& staging, const Say& say) {
  const TrackSource source(options.tracks,
                           [&](int64_t count) { return views_of_count(ids, count) != nullptr; });
  const auto matched = match_views(options.tracks, {}, source.times(), ids);
  const Lens& lens = capture.images->source(capture.train.front().id).lens;
  const double width = options.tracks_width > 0 ? options.tracks_width : lens.width;
  const Tensor<float> rows = source.rows(ids.listed_train, matched, width, lens.height * width / lens.width);
  int64_t seen = 0, inside = 0;
  for (int64_t i = 0; i < rows.size(); i += 3) {
    if (rows[i + 2] == 0) continue;
    ++seen;
    if (rows[i] >= 0 && rows[i] <= 1 && rows[i + 1] >= 0 && rows[i + 1] <= 1) ++inside;
  }
  if (2 * inside < seen || seen == 0) {
    throw InputError(options.tracks, "tracks",
                     fmt::format("{} of {} visible points in pictures {:g} pixels wide", inside, seen, width),
                     "most of them", "say with --tracks-width how wide the pictures were that were tracked");
  }
  write_npy(staging / tracks_kind.name, rows);
  say(fmt::format("{:<10}{} points on {} training views, each seen by {:.0f} in the mean ({})", "tracks",
                  source.points(), capture.train.size(),
                  static_cast<double>(inside) / static_cast<double>(source.points()), source.assumed()));
}

void attach_depths(const Capture& capture, const ViewIds& ids, const AttachOptions& options,
                   const Staging& staging, const Say& say, const std::atomic<bool>& stop) {
  const DepthSource source(options.depth, staging / "ffmpeg.log", stop);
  const auto matched = match_views(options.depth, source.names(), source.count(), ids);
  const auto take = [&](const auto& indices, const auto& f) { source.take(indices, f); };
  std::map<std::string, const View*> views;
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split) views.emplace(view.id, &view);
  }
  const SurfacePoints points(capture.points);
  std::map<std::string, std::vector<DepthSample>> samples;
  for_each_view(matched, take, [&](const std::string& id, const Tensor<float>& values) {
    if (stop) throw Stopped{};
    const Camera<float>& camera = views.at(id)->camera;
    require_proportions(options.depth, "depth", {values.dim(1), values.dim(0)}, id, camera.width,
                        camera.height);
    samples.emplace(id, depth_samples(capture, points, *views.at(id), values));
  });
  const DepthFits fits = fit_views(samples, options.depth_kind);
  if (2 * fits.of_view.size() < matched.size()) {
    throw InputError(options.depth, "depth",
                     fmt::format("values that fit the capture's points in {} of {} views",
                                 fits.of_view.size(), matched.size()),
                     "most of them",
                     "check the order of the views; the capture needs points on what stands still");
  }
  fs::create_directories(staging / depth_kind.name / "1x");
  for_each_view(matched, take, [&](const std::string& id, Tensor<float>& values) {
    if (stop) throw Stopped{};
    const auto fit = fits.of_view.find(id);
    if (fit == fits.of_view.end()) return;
    for (float& value : values.values()) value = static_cast<float>(fit->second.depth_of(value));
    write_npy(staging / depth_kind.name / "1x" / (id + ".npy"), values);
  });
  say(fmt::format("{:<10}{} of {} views, as {} with a scale and a shift for each; {:.1f}% off the points",
                  "depth", fits.of_view.size(), views.size(),
                  fits.kind == DepthKind::inverse ? "inverse depth" : "depth", 100 * fits.error()));
}

}  // namespace

void AttachOptions::validate() const {
  if (normals.empty() && masks.empty() && tracks.empty() && depth.empty())
    throw InputError("option", "normals", "nothing", "--normals, --masks, --tracks or --depth");
  if (tracks_width < 0)
    throw InputError("option", "tracks_width", std::to_string(tracks_width), "a number from 0 on");
}

std::map<std::string, int64_t> match_views(const std::string& origin, const std::vector<std::string>& names,
                                           int64_t count, const ViewIds& ids) {
  std::map<std::string, int64_t> by_name, matched;
  for (size_t i = 0; i < names.size(); ++i) by_name.emplace(stem_of(names[i]), static_cast<int64_t>(i));
  for (const std::string& id : ids.all) {
    const auto found = by_name.find(id);
    if (found != by_name.end()) matched.emplace(id, found->second);
  }
  const auto training =
      std::ranges::count_if(ids.train, [&](const std::string& id) { return matched.contains(id); });
  if (training == static_cast<std::ptrdiff_t>(ids.train.size())) return matched;
  const std::vector<std::string>* const list = views_of_count(ids, count);
  if (list == nullptr) {
    throw InputError(
        origin, "count", fmt::format("{}, of which {} have a training view's name", count, training),
        fmt::format("one for each of {} training views or of all {}", ids.train.size(), ids.all.size()),
        "make them from the capture's own pictures");
  }
  matched.clear();
  const std::set<std::string> there(ids.all.begin(), ids.all.end());
  for (size_t i = 0; i < list->size(); ++i) {
    if (there.contains((*list)[i])) matched.emplace((*list)[i], static_cast<int64_t>(i));
  }
  return matched;
}

FoundAxes find_axes(PriorAxes asked, const AxisEvidence& evidence, const std::string& origin) {
  const Vec3<double>& c = evidence.correlation;
  const std::string measured = fmt::format(
      "correlation with the geometry x {:+.2f}, y {:+.2f}, z {:+.2f} (against x right, y down, z forward) "
      "over {} samples",
      c.x, c.y, c.z, evidence.samples);
  if (asked != PriorAxes::automatic) {
    const AxisChoice choice = choose_prior_axes(asked, evidence);
    return {prior_axis_signs(asked), measured + ": " + prior_axes_name(asked) +
                                         (choice.warning.empty() ? "" : "; warning: " + choice.warning)};
  }
  const std::vector<PriorAxes> agreeing = agreeing_axes(evidence);
  if (agreeing.size() == 1)
    return {prior_axis_signs(agreeing.front()), measured + ": " + prior_axes_name(agreeing.front())};
  if (!agreeing.empty() || !decides_all(evidence)) {
    throw InputError(origin, "axes", measured, "what tells one kind of axes from the others",
                     "say which they are with --axes");
  }
  return {sign(c), measured + ": no known axes, taken as measured"};
}

void attach_priors(const fs::path& capture, const AttachOptions& options, const Say& say,
                   const std::atomic<bool>& stop) {
  options.validate();
  if (!fs::is_directory(capture)) {
    throw InputError(capture.string(), "", fs::exists(capture) ? "a file" : "nothing", "a capture's folder",
                     fs::exists(capture) ? "unpack it first" : "");
  }
  const FolderLock lock(capture / ".attach-priors.lock", capture, "attaching priors");
  if (!options.normals.empty()) refuse_to_replace(capture, normals_kind, options);
  if (!options.masks.empty()) refuse_to_replace(capture, masks_kind, options);
  if (!options.tracks.empty()) refuse_to_replace(capture, tracks_kind, options);
  if (!options.depth.empty()) refuse_to_replace(capture, depth_kind, options);
  const CaptureOptions size = at_largest_size(capture);
  const Capture loaded = load_capture(capture, size);
  const ViewIds ids = ids_in(loaded, size);
  const Staging staging(capture);
  if (!options.normals.empty()) attach_normals(loaded, ids, options, staging, say, stop);
  if (!options.masks.empty()) attach_masks(loaded, ids, options, staging, say, stop);
  if (!options.tracks.empty()) attach_tracks(loaded, ids, options, staging, say);
  if (!options.depth.empty()) attach_depths(loaded, ids, options, staging, say, stop);
  staging.move_in();
}

}  // namespace traceflow::prepare

#include "capture/formats/transforms/transforms.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "capture/formats/image_finder.h"
#include "capture/formats/image_names.h"
#include "capture/formats/normalise.h"
#include "capture/formats/ply_points.h"
#include "capture/formats/transforms/transforms_file.h"
#include "files/image.h"

namespace traceflow {

namespace {

constexpr const char* whole_file = "transforms.json";
constexpr const char* train_file = "transforms_train.json";
constexpr const char* test_file = "transforms_test.json";
constexpr const char* val_file = "transforms_val.json";

// "images/left/a.png" at scale 2 is "images_2/left/a.png".
std::string at_scale(const std::string& path, int stored) {
  const size_t slash = path.find('/');
  if (stored == 1 || slash == std::string::npos) return path;
  return path.substr(0, slash) + "_" + std::to_string(stored) + path.substr(slash);
}

// "images" for "images/left/a.png"; "" for a file at the top.
std::string top_folder(const std::string& path) {
  const size_t slash = path.find('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

// The ends of a path after each of its last slashes, the longest first.
std::vector<std::string> ends_of(const std::string& path) {
  constexpr size_t most = 8;
  std::vector<std::string> ends;
  for (size_t slash = path.rfind('/'); slash != std::string::npos && ends.size() < most;
       slash = slash == 0 ? std::string::npos : path.rfind('/', slash - 1))
    ends.push_back(path.substr(slash + 1));
  std::ranges::reverse(ends);
  return ends;
}

// 1, and each N for which a folder at the top is named anything_N.
std::set<int> scales_of(const FileTree& tree) {
  std::set<int> scales{1};
  const std::vector<std::string> folders = tree.folders_in("");
  for (int stored = 2; stored <= 64; ++stored) {
    const std::string end = "_" + std::to_string(stored);
    if (std::ranges::any_of(folders, [&](const auto& name) { return name.ends_with(end); }))
      scales.insert(stored);
  }
  return scales;
}

// Reads step by step into `found_`.
class TransformsReader {
 public:
  TransformsReader(std::shared_ptr<const FileTree> tree, const CaptureOptions& options)
      : tree_(std::move(tree)), options_(options), scales_(scales_of(*tree_)), finder_(*tree_) {}

  FoundCapture read() {
    tree_->has(train_file) ? read_split_files() : read_whole_file();
    list_other_files();
    drop_repeats();
    settle_paths();
    // Different paths may have become equal.
    drop_repeats();
    choose_sizes();
    list_images();
    read_times();
    make_views();
    read_points();
    std::vector<FoundView> all = found_.train;
    all.insert(all.end(), found_.test.begin(), found_.test.end());
    found_.normalisation = normalise(all, found_.points);
    return std::move(found_);
  }

 private:
  Finding& warn(const std::string& text, const std::string& kind, Severity severity = Severity::problem) {
    return found_.warnings.emplace_back(text, kind, severity);
  }

  TransformsFile file_called(const char* name) {
    files_.insert(name);
    return read_transforms_file(*tree_, name);
  }

  void read_split_files() {
    found_.background = Background::white;
    found_.format = "nerf-synthetic";
    origin_ = train_file;
    TransformsFile train = file_called(train_file);
    refuse_no_frames(train);
    take_split(std::move(train), false);
    const char* other = tree_->has(test_file) ? test_file : tree_->has(val_file) ? val_file : nullptr;
    if (other == nullptr) {
      warn("transforms_test.json is missing: there is nothing to evaluate on", "no-test", Severity::notice);
      return;
    }
    take_split(file_called(other), true);
  }

  void read_whole_file() {
    origin_ = whole_file;
    TransformsFile file = file_called(whole_file);
    refuse_no_frames(file);
    found_.format = file.is_nerfstudio ? "nerfstudio" : "instant-ngp";
    std::ranges::stable_sort(file.frames, natural_less, &TransformsFrame::path);
    const std::set<std::string> train(file.train.begin(), file.train.end()),
        test(file.test.begin(), file.test.end());
    const bool trains =
        std::ranges::any_of(file.frames, [&](const auto& f) { return train.contains(f.path); });
    if (!trains && !(train.empty() && test.empty())) {
      const JsonFile& json = *file.json;
      constexpr const char* expected = "the file_path of the frames to train on";
      constexpr const char* remedy =
          "list them, or take train_filenames, test_filenames and val_filenames away";
      if (json.has("train_filenames"))
        json["train_filenames"].fail(train.empty() ? "an empty list" : "no frame of the file", expected,
                                     remedy);
    }
    if (!train.empty()) {
      const auto in_no_split = std::stable_partition(
          file.frames.begin(), file.frames.end(),
          [&](const auto& f) { return train.contains(f.path) || test.contains(f.path); });
      for (auto frame = in_no_split; frame != file.frames.end(); ++frame) unused_.push_back(frame->path);
      if (!unused_.empty()) {
        warn(std::to_string(unused_.size()) +
                 " frames are in neither train_filenames nor test_filenames: left out",
             "in-no-split");
      }
      file.frames.erase(in_no_split, file.frames.end());
      for (TransformsFrame& frame : file.frames) frame.is_test = !train.contains(frame.path);
    }
    take(std::move(file));
  }

  static void refuse_no_frames(const TransformsFile& file) {
    if (!file.frames.empty()) return;
    (*file.json)["frames"].fail("an empty list", "the frames to train on", "list them");
  }

  void take_split(TransformsFile file, bool is_test) {
    for (TransformsFrame& frame : file.frames) frame.is_test = is_test;
    take(std::move(file));
  }

  void take(TransformsFile file) {
    const auto number = [](int n) { return std::to_string(n); };
    if (file.masks > 0) {
      warn(number(file.masks) +
               " frames name a mask_path: not used, since it says what to leave out, not where "
               "the moving object is",
           "not-used", Severity::notice);
    }
    if (file.depths > 0)
      warn(number(file.depths) + " frames name depth images: not used", "not-used", Severity::notice);
    const auto rolling =
        std::ranges::count_if(file.frames, [](const auto& frame) { return frame.lens.rolling_shutter; });
    if (rolling > 0) {
      warn(std::to_string(rolling) +
               " frames say how their camera moved while it took them (rolling_shutter): not used, "
               "each has one pose",
           "not-used", Severity::notice);
    }
    if (points_path_.empty()) points_path_ = file.points;
    // Fields point into their document.
    documents_.push_back(file.json);
    std::move(file.frames.begin(), file.frames.end(), std::back_inserter(frames_));
  }

  // Lists the frames of unused files, so that their images are not reported as unused.
  void list_other_files() {
    for (const char* file : {whole_file, train_file, test_file, val_file}) {
      if (files_.contains(file) || !tree_->has(file)) continue;
      const std::vector<std::string> paths = list_frames(*tree_, file);
      unused_.insert(unused_.end(), paths.begin(), paths.end());
    }
  }

  // The image with this path at 1/stored of the full size; empty if there is none. Files at the top have no
  // folder with a scale in its name.
  std::string image_at(const std::string& path, int stored) {
    if (stored > 1 && top_folder(path).empty()) return "";
    return finder_.find(at_scale(path, stored));
  }

  // Whether the image exists at full size or at another stored scale.
  bool is_there(const std::string& path) {
    return std::ranges::any_of(scales_, [&](int stored) { return !image_at(path, stored).empty(); });
  }

  // The longest end of the path that is an image in the tree; empty if there is none.
  std::string end_here(const std::string& path) {
    const std::vector<std::string> ends = ends_of(path);
    // is_there comes first: it is cheaper than path_in_tree, and most ends do not exist.
    const auto found = std::ranges::find_if(
        ends, [&](const std::string& end) { return is_there(end) && path_in_tree(end); });
    return found == ends.end() ? "" : *found;
  }

  // Removes a beginning that the paths of existing images also had; empty if the path has no such beginning.
  std::string without_beginning(const std::string& path) const {
    const std::vector<std::string> ends = ends_of(path);
    const auto known = std::ranges::find_if(ends, [&](const std::string& end) {
      return beginnings_.contains(path.substr(0, path.size() - end.size())) && path_in_tree(end);
    });
    return known == ends.end() ? "" : *known;
  }

  // Where a missing image would be: beside the others, or at its path. If the path leads out of the capture,
  // only the last part remains.
  std::string place_of_missing(const std::string& path) const {
    std::string beside_others = without_beginning(path);
    if (!beside_others.empty()) return beside_others;
    return path_in_tree(path) ? path : path.substr(path.rfind('/') + 1);
  }

  // The path as written, or beside the images, or the longest end of the path that exists.
  std::string place_of_points() const {
    std::vector<std::string> places = ends_of(points_path_);
    places.insert(places.begin(), {points_path_, without_beginning(points_path_)});
    const auto found =
        std::ranges::find_if(places, [&](const std::string& path) { return tree_->has(path); });
    return found == places.end() ? points_path_ : *found;
  }

  // Paths may be of another machine or folder. Their ends are searched in the tree.
  void settle_paths() {
    const bool as_written =
        std::ranges::any_of(frames_, [&](const TransformsFrame& frame) { return is_there(frame.path); });
    const auto end_of = [&](const std::string& path) {
      return as_written && path_in_tree(path) ? path : end_here(path);
    };
    std::vector<std::string> ends;
    for (const TransformsFrame& frame : frames_) {
      const std::string& end = ends.emplace_back(end_of(frame.path));
      if (!end.empty()) beginnings_.insert(frame.path.substr(0, frame.path.size() - end.size()));
    }
    std::vector<std::string> moved;
    const auto settle = [&](std::string& path, const std::string& place) {
      if (path != place) moved.push_back(std::exchange(path, place));
    };
    for (size_t i = 0; i < frames_.size(); ++i) {
      std::string& path = frames_[i].path;
      settle(path, ends[i].empty() ? place_of_missing(path) : ends[i]);
    }
    settle(points_path_, place_of_points());
    for (std::string& path : unused_) {
      const std::string end = end_of(path);
      path = end.empty() ? place_of_missing(path) : end;
    }
    if (moved.empty()) return;
    warn("the paths of " + ids_text(moved) +
             " are not in the capture as written: their last parts are looked for in it",
         "path-outside", Severity::notice)
        .files = moved;
  }

  // Keeps one of repeated frames, in the same file or across files.
  void drop_repeats() {
    std::set<std::string> seen;
    std::vector<std::string> repeated;
    std::vector<TransformsFrame> once;
    for (TransformsFrame& frame : frames_) {
      if (seen.insert(frame.path).second) {
        once.push_back(std::move(frame));
      } else {
        repeated.push_back(frame.path);
      }
    }
    frames_ = std::move(once);
    if (!repeated.empty())
      warn(ids_text(repeated) + " named more than once: used once", "repeated-id").files = repeated;
  }

  void choose_sizes() {
    const auto has_some = [&](int stored) {
      return scales_.contains(stored) && std::ranges::any_of(frames_, [&](const TransformsFrame& frame) {
               return !image_at(frame.path, stored).empty();
             });
    };
    const auto first =
        std::ranges::find_if(frames_, [&](const TransformsFrame& frame) { return is_there(frame.path); });
    if (first == frames_.end()) {
      throw InputError(tree_->name_of(origin_), "frames",
                       "none of " + std::to_string(frames_.size()) + " images",
                       "files at their file_path, with or without .png or .jpg",
                       frames_.empty() ? "" : "the first is " + frames_.front().path);
    }
    const auto folder_at = [&](int stored) { return top_folder(at_scale(first->path, stored)); };
    found_.images = choose_images(tree_->name_of(folder_at(1)), options_.downscale, has_some, folder_at);
  }
  std::string stored_path(const std::string& path) const { return at_scale(path, found_.images.stored); }

  void list_images() {
    const auto list = [&](const std::string& path) {
      found_.listed_images.push_back(without_extension(stored_path(path)));
    };
    for (const TransformsFrame& frame : frames_) list(frame.path);
    for (const std::string& path : unused_) list(path);
  }

  void read_times() {
    std::vector<std::string> without;
    std::optional<double> first;
    for (const TransformsFrame& frame : frames_) {
      if (!frame.time) without.push_back(frame.path);
      if (frame.time) first = std::min(first.value_or(*frame.time), *frame.time);
    }
    if (!first) {
      found_.times = CaptureTimes::none;
      return;
    }
    if (found_.format == "nerf-synthetic") found_.format = "d-nerf";
    for (TransformsFrame& frame : frames_) frame.time = frame.time.value_or(*first);
    if (!without.empty() && options_.times == CaptureTimes::automatic) {
      warn("frames without a time (" + ids_text(without) + "): taken for the first", "missing-time").files =
          without;
    }
  }

  void make_views() {
    std::vector<std::string> paths;
    for (const TransformsFrame& frame : frames_) paths.push_back(frame.path);
    found_.all_ids = image_ids(paths, [&](size_t i) { return frames_[i].file; });
    std::map<std::string, size_t> place;
    for (size_t i = 0; i < paths.size(); ++i) place.emplace(found_.all_ids[i], i);
    for (const std::string& path : paths) images_.push_back(image_at(path, found_.images.stored));
    const auto exists = [&](const std::string& id) { return !images_[place.at(id)].empty(); };
    const auto usual_path = [&](const std::string& id) { return stored_path(frames_[place.at(id)].path); };
    const auto whole =
        keep_whole(found_.all_ids, "listed", "image", exists, found_.warnings, "missing-image", usual_path);
    std::vector<FoundView> views(whole.size());
    parallel_for(
        "capture: frames", static_cast<int64_t>(whole.size()),
        [&](int64_t n) {
          const auto i = static_cast<size_t>(n);
          views[i] = view_of(whole[i], place.at(whole[i]));
        },
        1);
    for (size_t n = 0; n < whole.size(); ++n) {
      const bool is_test = frames_[place.at(whole[n])].is_test.value_or(tests(n, options_.test_every));
      if (!is_test) found_.train_ids.push_back(whole[n]);
      (is_test ? found_.test : found_.train).push_back(std::move(views[n]));
    }
  }

  FoundView view_of(const std::string& id, size_t i) const {
    const TransformsFrame& frame = frames_[i];
    FoundView view{id,
                   {tree_, images_[i]},
                   {},
                   frame.file + ": " + frame.path,
                   frame.pose.camera_from_world,
                   frame.pose.position,
                   frame.time.value_or(0),
                   ""};
    ImageSize size{0, 0, 0};
    if (!frame.lens.width || !frame.lens.height) size = read_image_size(view.image.open());
    const int stored = found_.images.stored;
    view.lens = frame.lens.lens(size.width * stored, size.height * stored, *frame.json);
    return view;
  }

  void read_points() {
    if (points_path_.empty()) return;
    if (!tree_->has(points_path_)) {
      warn(points_path_ + " (ply_file_path) is missing", "points-unreadable").files = {points_path_};
      return;
    }
    try {
      found_.points = read_ply_points(tree_->open_file(points_path_));
      if (!found_.points.empty()) found_.points_file = points_path_;
    } catch (const InputError& error) {
      warn(std::string("points not used: ") + error.what(), "points-unreadable").files = {points_path_};
    }
  }

  const std::shared_ptr<const FileTree> tree_;
  const CaptureOptions options_;
  const std::set<int> scales_;  // that folder names end with
  ImageFinder finder_;
  std::string origin_;  // the file to name in errors
  std::vector<std::shared_ptr<const JsonFile>> documents_;
  std::vector<TransformsFrame> frames_;
  std::vector<std::string> images_;   // of frames_, at the selected size; empty if missing
  std::vector<std::string> unused_;   // paths of frames that give no view
  std::set<std::string> files_;       // the files that were read
  std::set<std::string> beginnings_;  // removed from paths of existing images
  std::string points_path_;
  FoundCapture found_;
};

}  // namespace

bool is_transforms(const FileTree& tree) { return tree.has(whole_file) || tree.has(train_file); }

FoundCapture read_transforms(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  return TransformsReader(tree, options).read();
}

}  // namespace traceflow

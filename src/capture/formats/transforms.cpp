#include "capture/formats/transforms.h"

#include <algorithm>
#include <map>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "capture/formats/image_names.h"
#include "capture/formats/normalise.h"
#include "capture/formats/ply_points.h"
#include "capture/formats/transforms_file.h"
#include "files/image.h"

namespace traceflow {

namespace {

constexpr const char* whole_file = "transforms.json";
constexpr const char* train_file = "transforms_train.json";
constexpr const char* test_file = "transforms_test.json";
constexpr const char* val_file = "transforms_val.json";

// "images/left/a.png" at scale 2: "images_2/left/a.png".
std::string at_scale(const std::string& path, int stored) {
  const size_t slash = path.find('/');
  if (stored == 1 || slash == std::string::npos) return path;
  return path.substr(0, slash) + "_" + std::to_string(stored) + path.substr(slash);
}

// Reads step by step into `found_`.
class TransformsReader {
 public:
  TransformsReader(std::shared_ptr<const FileTree> tree, const CaptureOptions& options)
      : tree_(std::move(tree)), options_(options) {}

  FoundCapture read() {
    tree_->has(train_file) ? read_split_files() : read_whole_file();
    settle_paths();
    choose_images();
    choose_times();
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

  void read_split_files() {
    found_.background = Background::white;
    found_.format = "nerf-synthetic";
    origin_ = train_file;
    take(read_transforms_file(*tree_, train_file));
    is_test_.assign(frames_.size(), false);
    const char* other = tree_->has(test_file) ? test_file : tree_->has(val_file) ? val_file : nullptr;
    if (other == nullptr) {
      warn("transforms_test.json is missing: there is nothing to evaluate on", "no-test", Severity::notice);
      return;
    }
    take(read_transforms_file(*tree_, other));
    is_test_.resize(frames_.size(), true);
  }

  void read_whole_file() {
    origin_ = whole_file;
    TransformsFile file = read_transforms_file(*tree_, whole_file);
    found_.format = file.is_nerfstudio ? "nerfstudio" : "instant-ngp";
    std::stable_sort(file.frames.begin(), file.frames.end(),
                     [](const auto& a, const auto& b) { return natural_less(a.path, b.path); });
    const std::set<std::string> train(file.train.begin(), file.train.end()),
        test(file.test.begin(), file.test.end());
    if (!train.empty()) {
      const size_t all = file.frames.size();
      std::erase_if(file.frames,
                    [&](const auto& f) { return !train.contains(f.path) && !test.contains(f.path); });
      if (file.frames.size() < all) {
        warn(std::to_string(all - file.frames.size()) +
                 " frames are in neither train_filenames nor test_filenames: left out",
             "in-no-split");
      }
    }
    take(std::move(file));
    if (train.empty()) return;
    for (const TransformsFrame& frame : frames_)
      is_test_.push_back(test.contains(frame.path) && !train.contains(frame.path));
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
    if (points_path_.empty()) points_path_ = file.points;
    // Fields point into their document.
    documents_.push_back(file.json);
    // A frame that comes again, in the same file or in the other, is taken once.
    std::vector<std::string> repeated;
    for (TransformsFrame& frame : file.frames) {
      if (seen_.insert(frame.path).second) {
        frames_.push_back(std::move(frame));
      } else {
        repeated.push_back(frame.path);
      }
    }
    if (!repeated.empty())
      warn(ids_text(repeated) + " named more than once: used once", "repeated-id").files = repeated;
  }

  // Paths of the machine that wrote the file: their ends may be here.
  void settle_paths() {
    std::vector<std::string> moved;
    for (TransformsFrame& frame : frames_) {
      if (path_in_tree(frame.path)) continue;
      const std::string written = frame.path;
      for (size_t slash = frame.path.find('/'); slash != std::string::npos; slash = frame.path.find('/')) {
        frame.path = frame.path.substr(slash + 1);
        if (path_in_tree(frame.path) && !find_image(*tree_, frame.path).empty()) break;
      }
      moved.push_back(written);
    }
    if (moved.empty()) return;
    warn(
        "the paths of " + ids_text(moved) + " lead out of the capture: their last parts are looked for in it",
        "path-outside", Severity::notice)
        .files = moved;
  }

  void choose_images() {
    const auto first = std::find_if(frames_.begin(), frames_.end(), [&](const TransformsFrame& frame) {
      return !find_image(*tree_, frame.path).empty();
    });
    if (first == frames_.end()) {
      throw InputError(tree_->name_of(origin_), "frames",
                       "none of " + std::to_string(frames_.size()) + " images",
                       "files at their file_path, with or without .png or .jpg",
                       frames_.empty() ? "" : "the first is " + frames_.front().path);
    }
    found_.images = choose_stored_images(*tree_, options_.downscale,
                                         [&](int stored) { return at_scale(first->path, stored); });
  }
  std::string image_of(const TransformsFrame& frame) const {
    return find_image(*tree_, at_scale(frame.path, found_.images.stored));
  }

  void choose_times() {
    std::vector<std::string> paths, without;
    for (const TransformsFrame& frame : frames_) {
      paths.push_back(frame.path);
      if (!frame.time) without.push_back(frame.path);
    }
    times_.assign(frames_.size(), 0);
    const bool timed = without.size() < frames_.size();
    found_.says_times =
        options_.times == CaptureTimes::names || (options_.times == CaptureTimes::automatic && timed);
    if (options_.times == CaptureTimes::names) {
      times_ = times_by_names(paths);
    } else if (options_.times == CaptureTimes::automatic && timed) {
      if (found_.format == "nerf-synthetic") found_.format = "d-nerf";
      if (!without.empty())
        warn("frames without a time (" + ids_text(without) + "): taken for the first", "missing-time").files =
            without;
      double first = 0;
      for (const TransformsFrame& frame : frames_) first = std::min(first, frame.time.value_or(0));
      for (size_t i = 0; i < times_.size(); ++i) times_[i] = frames_[i].time.value_or(first) - first;
    }
  }

  void make_views() {
    std::vector<std::string> paths;
    for (const TransformsFrame& frame : frames_) paths.push_back(frame.path);
    found_.all_ids = image_ids(paths, tree_->name_of(origin_));
    std::map<std::string, size_t> place;
    for (size_t i = 0; i < paths.size(); ++i) place.emplace(found_.all_ids[i], i);
    const auto exists = [&](const std::string& id) { return !image_of(frames_[place.at(id)]).empty(); };
    const auto usual_path = [&](const std::string& id) {
      return at_scale(frames_[place.at(id)].path, found_.images.stored);
    };
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
      const bool is_test = is_test_.empty() ? tests(n, options_.test_every) : is_test_[place.at(whole[n])];
      if (!is_test) found_.train_ids.push_back(whole[n]);
      (is_test ? found_.test : found_.train).push_back(std::move(views[n]));
    }
  }

  FoundView view_of(const std::string& id, size_t i) const {
    const TransformsFrame& frame = frames_[i];
    FoundView view{id,
                   {tree_, image_of(frame)},
                   {},
                   tree_->name_of(origin_) + ": " + frame.path,
                   frame.pose.camera_from_world,
                   frame.pose.position,
                   times_[i],
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
  std::string origin_;  // the file to name in errors
  std::vector<std::shared_ptr<const JsonFile>> documents_;
  std::vector<TransformsFrame> frames_;
  std::vector<bool> is_test_;  // of frames_; empty where nobody says
  std::vector<double> times_;
  std::set<std::string> seen_;
  std::string points_path_;
  FoundCapture found_;
};

}  // namespace

bool is_transforms(const FileTree& tree) { return tree.has(whole_file) || tree.has(train_file); }

FoundCapture read_transforms(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  return TransformsReader(tree, options).read();
}

}  // namespace traceflow

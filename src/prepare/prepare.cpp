#include "prepare/prepare.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/folder_lock.h"
#include "base/utf8.h"
#include "files/options_json.h"
#include "prepare/capture_folder.h"
#include "prepare/frames.h"
#include "prepare/given_poses.h"
#include "prepare/masks.h"
#include "prepare/poses.h"
#include "prepare/programs.h"
#include "prepare/steps.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Increased when the resulting capture changes; existing captures are then made again from their poses.
constexpr int made_capture = 2;

// Resolves links, so that results are beside a link's target and can be moved into place.
fs::path without_links(const fs::path& path) {
  const fs::path whole = fs::weakly_canonical(fs::absolute(path));
  return whole.has_filename() ? whole : whole.parent_path();
}

// The steps of one capture, in order. Each passes to Steps the inputs of its results beyond the earlier
// steps.
class Preparation {
 public:
  Preparation(fs::path input, fs::path capture, const PrepareOptions& options,
              const ProgressCallbacks& callbacks, const std::atomic<bool>& stop)
      : input_(std::move(input)),
        capture_(without_links(capture)),
        folder_(work_folder(capture_)),
        options_(options),
        work_(stop, [this](int64_t done, int64_t all) { audience_.at_work(step_, done, all); }),
        audience_(callbacks),
        steps_(folder_, callbacks.found, [this] { before_work(); }) {}

  void run() {
    for (const fs::path& given : {input_, fs::path(options_.masks), fs::path(options_.test_video)})
      refuse_own_folders(given);
    if (options_.gives_poses()) open_pose_file();
    for (const Step step :
         {Step::frames, Step::masks, Step::features, Step::matches, Step::poses, Step::capture}) {
      if (step > options_.until) return;
      work_.check();
      step_ = step;
      run_step(step);
      if (step == Step::frames) frames_ = read_frames(frame_list());
      // Before the long work on masks.
      if (step == Step::frames && pose_file_) require_fit(*pose_file_, frames_, pictures());
    }
  }

 private:
  fs::path pictures() const { return folder_ / "frames"; }
  fs::path masks() const { return folder_ / "masks"; }
  fs::path made() const { return folder_ / "capture"; }
  fs::path aside() const { return folder_ / "replaced"; }
  fs::path frame_list() const { return folder_ / "frames.list.json"; }
  PoseFolder poses() const { return {folder_ / "colmap"}; }

  // Refuses input inside folders that this preparation empties or replaces.
  void refuse_own_folders(const fs::path& given) const {
    if (given.empty() || !fs::exists(given)) return;
    const auto lies_in = [place = fs::weakly_canonical(given)](const fs::path& folder) {
      const fs::path own = fs::weakly_canonical(folder);
      return std::mismatch(own.begin(), own.end(), place.begin(), place.end()).first == own.end();
    };
    const auto refuse = [&](const std::string& found, const fs::path& folder) {
      throw InputError(given.string(), "", found, "another place", "copy it out of " + folder.string());
    };
    for (const fs::path& own : {pictures(), masks(), poses().top, made(), aside()}) {
      if (lies_in(own)) refuse("a folder that this preparation writes itself", folder_);
    }
    if (!lies_in(capture_)) return;
    // If the folder is not a capture, this reports it as such.
    check_place(capture_);
    refuse("a part of the capture that this preparation replaces", capture_);
  }

  void open_pose_file() {
    const fs::path path(options_.poses);
    if (!fs::is_regular_file(path)) {
      throw InputError("option", "poses",
                       options_.poses + (fs::exists(path) ? ", which is no file" : ", which does not exist"),
                       "colmap, or an .npz file of MegaSaM");
    }
    refuse_own_folders(path);
    pose_file_.emplace(path);
  }

  // Checks before hours of work that the capture's place is free or can be freed, and that no other process
  // does the same work.
  void before_work() {
    if (options_.until == Step::capture) check_place(capture_);
    fs::create_directories(folder_);
    if (!lock_) {
      lock_.emplace(folder_ / "lock", folder_, "preparing");
      if (options_.until == Step::capture) check_movable(capture_, folder_ / "trial");
    }
    work_.tell(0, 0);
  }

  // A step that only COLMAP needs.
  void skip_step(Step step) {
    steps_.run(
        step, {{"poses", "of a file"}}, [] { return true; },
        [] { return "none, since --poses gives the cameras"; });
  }

  void run_step(Step step) {
    if (pose_file_ && (step == Step::features || step == Step::matches)) return skip_step(step);
    switch (step) {
      case Step::frames:
        return take_frames();
      case Step::masks:
        return steps_.run(
            step, mask_inputs(), [&] { return !wants_masks(options_) || fs::is_directory(masks()); },
            [&] { return make_masks(options_, frames_, pictures(), masks(), folder_ / "masks.log", work_); });
      case Step::features:
        return steps_.run(
            step,
            {{"features", options_.features}, {"camera_model", static_cast<int>(options_.camera_model)}},
            [&] { return fs::exists(poses().features()); },
            [&] { return extract_features(options_, frames_, pictures(), masks(), poses(), work_); });
      case Step::matches:
        return steps_.run(
            step, {{"matcher", static_cast<int>(options_.matcher)}, {"overlap", options_.overlap}},
            [&] { return fs::exists(poses().matches()); },
            [&] { return match_features(options_, frames_, poses(), work_); });
      case Step::poses:
        if (pose_file_) {
          return steps_.run(
              step, {{"poses", identity_of(options_.poses)}}, [&] { return fs::exists(poses().chosen()); },
              [&] { return use_given_poses(*pose_file_, frames_, masks(), poses(), work_); });
        }
        steps_.run(
            step, json::object(), [&] { return fs::exists(poses().chosen()); },
            [&] { return find_poses(options_, frames_, pictures(), poses(), work_); });
        // Not part of the step: a changed --least-registered must not run the mapper again.
        return require_registered(options_, frames_, poses());
      case Step::capture:
        return steps_.run(
            step, {{"test_every", options_.test_every}, {"made", made_capture}},
            [&] { return fs::exists(capture_ / "prepare.json"); }, [&] { return finish(); });
    }
  }

  void take_frames() {
    json inputs{{"input", identity_of(input_)}, {"frames", options_.frames}, {"rate", options_.rate},
                {"start", options_.start},      {"end", options_.end},       {"size", options_.size}};
    if (!options_.test_video.empty()) {
      inputs["test_video"] = identity_of(options_.test_video);
      inputs["test_offset"] = options_.test_offset;
      inputs["test_every"] = options_.test_every;
    }
    steps_.run(
        Step::frames, inputs, [&] { return fs::exists(frame_list()) && fs::is_directory(pictures()); },
        [&] {
          const Frames frames =
              prepare::take_frames(input_, options_, pictures(), folder_ / "ffmpeg.log", work_);
          write_frames(frame_list(), frames);
          return told_of(frames);
        });
  }

  static std::string told_of(const Frames& frames) {
    const Frame &first = frames.frames.front(), *last = &first;
    int64_t second_camera = 0;
    for (const Frame& frame : frames.frames) {
      second_camera += frame.camera;
      if (frame.camera == 0) last = &frame;
    }
    const auto taken = static_cast<int64_t>(frames.frames.size()) - second_camera;
    std::string text = fmt::format("{} of {} pictures, the sharpest of each interval, {}×{}", taken,
                                   frames.source_frames.front(), first.width, first.height);
    if (first.is_of_film()) text += fmt::format(", over {:.2f} s", last->time);
    if (second_camera > 0)
      text += fmt::format("; {} of the test camera's {}", second_camera, frames.source_frames.back());
    return text;
  }

  json mask_inputs() const {
    if (options_.masks == "none" || options_.masks == "estimate") return {{"masks", options_.masks}};
    if (!fs::exists(options_.masks)) {
      throw InputError("option", "masks", options_.masks + ", which does not exist",
                       "estimate, none, a folder or a film");
    }
    return {{"masks", identity_of(options_.masks)}, {"mask_white", static_cast<int>(options_.mask_white)}};
  }

  std::string finish() {
    std::string found =
        write_capture(options_, {frames_, pictures(), masks(), read_chosen_model(poses())}, made(), work_);
    json told{{"input", as_utf8(fs::absolute(input_).string())},
              {"options", json::parse(options_to_json(options_))}};
    for (const Step step : {Step::frames, Step::masks, Step::features, Step::matches, Step::poses}) {
      const json stamp = steps_.stamp(step);
      told["steps"][step_name(step)] = {{"found", stamp.at("found")}, {"seconds", stamp.at("seconds")}};
    }
    write_atomically(made() / "prepare.json", told.dump(1) + "\n");
    move_into_place(made(), capture_, aside());
    return found;
  }

  fs::path input_, capture_, folder_;
  const PrepareOptions& options_;
  const Work work_;
  const ProgressCallbacks& audience_;
  Step step_ = Step::frames;
  std::optional<FolderLock> lock_;
  Steps steps_;
  Frames frames_;
  std::optional<PoseFile> pose_file_;  // of --poses
};

}  // namespace

fs::path work_folder(const fs::path& capture) { return without_links(capture).string() + ".prepare"; }

bool prepare_capture(const fs::path& input, const fs::path& capture, const PrepareOptions& options,
                     const ProgressCallbacks& callbacks, const std::atomic<bool>& stop) {
  options.validate();
  if (!fs::exists(input)) throw InputError(input.string(), "", "nothing", "a film or a folder of pictures");
  need_program("ffmpeg");
  if (options.until > Step::masks && !options.gives_poses()) need_program("colmap");
  try {
    Preparation(input, capture, options, callbacks, stop).run();
  } catch (const Stopped&) {
    return false;
  }
  return true;
}

}  // namespace traceflow::prepare

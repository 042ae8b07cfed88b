#include "prepare/prepare.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/folder_lock.h"
#include "files/options_json.h"
#include "prepare/capture_folder.h"
#include "prepare/frames.h"
#include "prepare/masks.h"
#include "prepare/poses.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The steps of one capture, in order. Each tells Steps what its results depend on beyond the steps before.
class Preparation {
 public:
  Preparation(fs::path input, fs::path capture, const PrepareOptions& options, const Steps::Say& say,
              const std::atomic<bool>& stop)
      : input_(std::move(input)),
        capture_(std::move(capture)),
        work_(work_folder(capture_)),
        options_(options),
        stop_(&stop),
        steps_(work_, say, [this] { before_work(); }) {}

  void run() {
    for (const Step step :
         {Step::frames, Step::masks, Step::features, Step::matches, Step::poses, Step::capture}) {
      if (step > options_.until) return;
      if (*stop_) throw Stopped{};
      run_step(step);
      if (step == Step::frames) frames_ = read_frames(frame_list());
    }
  }

 private:
  fs::path pictures() const { return work_ / "frames"; }
  fs::path masks() const { return work_ / "masks"; }
  fs::path frame_list() const { return work_ / "frames.list.json"; }
  PoseFolder poses() const { return {work_ / "colmap"}; }

  // Before hours go into steps whose capture would find its place taken, or into ones that another process
  // does as well.
  void before_work() {
    if (options_.until == Step::capture) check_place(capture_);
    fs::create_directories(work_);
    if (!lock_) lock_.emplace(work_ / "lock", work_, "preparing");
  }

  void run_step(Step step) {
    switch (step) {
      case Step::frames:
        return take_frames();
      case Step::masks:
        return steps_.run(
            step, mask_inputs(), [&] { return !wants_masks(options_) || fs::is_directory(masks()); },
            [&] { return make_masks(options_, frames_, pictures(), masks(), work_ / "masks.log", *stop_); });
      case Step::features:
        return steps_.run(
            step,
            {{"features", options_.features}, {"camera_model", static_cast<int>(options_.camera_model)}},
            [&] { return fs::exists(poses().features()); },
            [&] { return extract_features(options_, frames_, pictures(), masks(), poses(), *stop_); });
      case Step::matches:
        return steps_.run(
            step, {{"matcher", static_cast<int>(options_.matcher)}, {"overlap", options_.overlap}},
            [&] { return fs::exists(poses().matches()); },
            [&] { return match_features(options_, frames_, poses(), *stop_); });
      case Step::poses:
        return steps_.run(
            step, {{"least_registered", options_.least_registered}},
            [&] { return fs::exists(poses().chosen()); },
            [&] { return find_poses(options_, frames_, pictures(), poses(), *stop_); });
      case Step::capture:
        return steps_.run(
            step, {{"test_every", options_.test_every}},
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
              prepare::take_frames(input_, options_, pictures(), work_ / "ffmpeg.log", *stop_);
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
    if (first.source.empty()) text += fmt::format(", over {:.2f} s", last->time);
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
    return {{"masks", identity_of(options_.masks)}};
  }

  std::string finish() {
    const fs::path made = work_ / "capture";
    std::string found =
        write_capture(options_, {frames_, pictures(), masks(), read_chosen_model(poses())}, made, *stop_);
    json told{{"input", fs::absolute(input_).string()}, {"options", json::parse(options_to_json(options_))}};
    for (const Step step : {Step::frames, Step::masks, Step::features, Step::matches, Step::poses}) {
      const json stamp = steps_.stamp(step);
      told["steps"][step_name(step)] = {{"found", stamp.at("found")}, {"seconds", stamp.at("seconds")}};
    }
    write_atomically(made / "prepare.json", told.dump(1) + "\n");
    move_into_place(made, capture_, work_ / "replaced");
    return found;
  }

  fs::path input_, capture_, work_;
  const PrepareOptions& options_;
  const std::atomic<bool>* stop_;
  std::optional<FolderLock> lock_;
  Steps steps_;
  Frames frames_;
};

}  // namespace

fs::path work_folder(const fs::path& capture) {
  fs::path whole = fs::absolute(capture).lexically_normal();
  if (!whole.has_filename()) whole = whole.parent_path();
  return whole.string() + ".prepare";
}

bool prepare_capture(const fs::path& input, const fs::path& capture, const PrepareOptions& options,
                     const Steps::Say& say, const std::atomic<bool>& stop) {
  options.validate();
  if (!fs::exists(input)) throw InputError(input.string(), "", "nothing", "a film or a folder of pictures");
  need_program("ffmpeg");
  if (options.until > Step::masks) need_program("colmap");
  try {
    Preparation(input, capture, options, say, stop).run();
  } catch (const Stopped&) {
    return false;
  }
  return true;
}

}  // namespace traceflow::prepare

#include "cli/runs/trained_run.h"

#include <cmath>

#include "files/options_json.h"
#include "scene/run_folder.h"
#include "scene/scene_file.h"
#include "train/schedule.h"

namespace traceflow::cli {

std::string run_name(const std::filesystem::path& folder) {
  return (std::filesystem::absolute(folder) / "").lexically_normal().parent_path().filename().string();
}

TrainedRun read_run(const std::filesystem::path& folder) {
  const RunFolder files{folder};
  const std::string where = files.checkpoint().string();
  TrainedRun run;
  const Safetensors file = read_checkpoint(files, run.note);
  options_from_json(file.text("options"), option_fields(run.options), where + ": options");
  run.options.validate();
  run.subject.scene = get_scene(file);
  run.subject.render = run.options.render;
  run.iterations = std::llround(file.number("iteration"));
  run.subject.request = picture_request(run.options, run.iterations);
  run.train_seconds = file.number("train_seconds");
  run.capture = file.text("capture");
  run.capture_folder = file.text("capture_folder");
  return run;
}

Capture capture_of(const TrainedRun& run, const std::filesystem::path& folder, int downscale) {
  CaptureOptions options = run.options.capture;
  if (downscale > 0) options.downscale = downscale;
  if (!folder.empty()) return load_capture(folder, options);
  if (!std::filesystem::exists(run.capture_folder)) {
    throw InputError(run.capture_folder.string(), "", "no such folder",
                     "the capture that the run was trained on", "say where it is now with -d CAPTURE");
  }
  return load_capture(run.capture_folder, options);
}

const std::vector<View>& views_of(const Capture& capture, const std::string& split) {
  const std::vector<View>& views = split == "train" ? capture.train : capture.test;
  if (views.empty()) {
    throw InputError(capture.folder.string(), "split " + split, "no views", "at least one",
                     split == "train" ? "" : "try --split train");
  }
  return views;
}

}  // namespace traceflow::cli

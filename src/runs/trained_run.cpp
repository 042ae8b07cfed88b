#include "runs/trained_run.h"

#include <cmath>

#include "scene/run_folder.h"
#include "scene/scene_file.h"
#include "train/continuation.h"
#include "train/schedule.h"

namespace traceflow {

std::string run_name(const std::filesystem::path& folder) {
  return (std::filesystem::absolute(folder) / "").lexically_normal().parent_path().filename().string();
}

TrainedRun read_run(const std::filesystem::path& folder) {
  const RunFolder files{folder};
  const std::string where = files.checkpoint().string();
  TrainedRun run;
  const Safetensors file = read_checkpoint(files, run.note);
  run.options = options_in(file, where);
  // Only the render options are validated: limits of training do not concern its result.
  run.options.render.validate();
  run.subject.scene = get_scene(file);
  run.iterations = std::llround(file.number("iteration"));
  run.subject.render = picture_render(run.options, run.iterations);
  run.subject.request = picture_request(run.options, run.iterations);
  run.train_seconds = file.number("train_seconds");
  run.views = views_in(file);
  run.cameras = corrections_in(file);
  run.capture = file.text("capture");
  run.capture_folder = file.text("capture_folder");
  return run;
}

bool has_views_of(const TrainedRun& run, const Capture& capture) {
  return are_views_of(run.views, run.subject.scene.normalisation, capture);
}

Capture capture_of(const TrainedRun& run, const std::filesystem::path& folder, int downscale,
                   std::string& warning) {
  CaptureOptions options = run.options.capture;
  if (downscale > 0) options.downscale = downscale;
  const std::filesystem::path& where = folder.empty() ? run.capture_folder : folder;
  if (folder.empty() && !std::filesystem::exists(where)) {
    throw InputError(where.string(), "", "no such folder", "the capture that the run was trained on",
                     "say where it is now with -d CAPTURE");
  }
  Capture capture = load_capture(where, options);
  if (!has_views_of(run, capture)) {
    warning = where.string() +
              ": its training views are not those that the run was trained on: times may have moved, and "
              "views that were trained on may be test views now";
    return capture;
  }
  for (size_t i = 0; i < capture.train.size(); ++i) {
    Camera<float>& camera = capture.train[i].camera;
    camera = run.cameras.applied(camera, static_cast<int64_t>(i));
  }
  return capture;
}

const std::vector<View>& views_of(const Capture& capture, const std::string& split) {
  const std::vector<View>& views = split == "train" ? capture.train : capture.test;
  if (views.empty()) {
    throw InputError(capture.folder.string(), "split " + split, "no views", "at least one",
                     split == "train" ? "" : "try --split train");
  }
  return views;
}

}  // namespace traceflow

#pragma once

#include <filesystem>
#include <string>

#include "train/camera_refinement.h"
#include "train/options.h"
#include "viz/subject.h"

namespace traceflow {

// A run as those read it who show or measure it.
struct TrainedRun {
  viz::Subject subject;  // with the parts that had started to train (method §7.1–§7.3)
  TrainOptions options;
  std::string capture;                   // its name
  std::filesystem::path capture_folder;  // where it was during training
  CameraCorrections cameras;             // of the views that the run was trained on
  std::string views;       // identifies the views that the run was trained on, as stored in the checkpoint
  int64_t iterations = 0;  // completed
  double train_seconds = 0;
  std::string note;  // one line if the checkpoint is not the newest; else empty
};

// The name of a run's folder, for any spelling of its path.
std::string run_name(const std::filesystem::path& folder);

// Throws InputError.
TrainedRun read_run(const std::filesystem::path& folder);

// The capture that the run was trained on, or the one in `folder` if given. downscale 0: the run's. Training
// views get the cameras that the run refined, unless the capture's views are not those of the training: then
// `warning` gets one line, and otherwise stays as it is. Throws InputError.
Capture capture_of(const TrainedRun& run, const std::filesystem::path& folder, int downscale,
                   std::string& warning);

// Whether the capture's training views are those of the run, as far as the checkpoint shows.
bool has_views_of(const TrainedRun& run, const Capture& capture);

// The views of the named split. Throws InputError if the capture has none.
const std::vector<View>& views_of(const Capture& capture, const std::string& split);

}  // namespace traceflow

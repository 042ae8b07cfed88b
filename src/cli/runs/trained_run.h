#pragma once

#include <filesystem>
#include <string>

#include "train/camera_refinement.h"
#include "train/options.h"
#include "viz/subject.h"

namespace traceflow::cli {

// A run's folder as eval, render and export see it.
struct TrainedRun {
  viz::Subject subject;  // takes part as far as the run has come (method §7.1–§7.3)
  TrainOptions options;
  std::string capture;                   // its name
  std::filesystem::path capture_folder;  // where it was when the run was trained
  CameraCorrections cameras;             // of the views that it was trained on
  std::string views;                     // that it was trained on, as a checkpoint tells them
  int64_t iterations = 0;                // done
  double train_seconds = 0;
  std::string note;  // one line when the checkpoint is not the newest; else empty
};

// The name of a run's folder, however its path is written.
std::string run_name(const std::filesystem::path& folder);

// Throws InputError.
TrainedRun read_run(const std::filesystem::path& folder);

// The capture that the run was trained on, or the one in `folder` when that is not empty; downscale 0: the
// run's. Training views have the cameras that the run has refined. Says on the standard error where its views
// are not those that the run was trained on.
Capture capture_of(const TrainedRun& run, const std::filesystem::path& folder, int downscale);

// Whether a capture's training views are those that the run was trained on, as far as its checkpoint tells.
bool has_views_of(const TrainedRun& run, const Capture& capture);

// The views of a split by its name. Throws InputError when the capture has none.
const std::vector<View>& views_of(const Capture& capture, const std::string& split);

}  // namespace traceflow::cli

#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "prepare/options.h"

namespace traceflow::prepare {

// Callbacks that report the progress of a preparation.
struct ProgressCallbacks {
  // The result of a step, one line each.
  std::function<void(const std::string& line)> found;
  // The progress of the present step; 0 of 0 when it starts. all is 0 if unknown.
  std::function<void(Step step, int64_t done, int64_t all)> at_work = [](Step, int64_t, int64_t) {};
};

// Makes a capture from a video or a folder of images (docs/prepare.md), with the programs ffmpeg and colmap.
// Intermediate results are kept in CAPTURE.prepare, so that a later call continues where this one ended.
// Returns false if `stop` became true before the end. Throws InputError.
bool prepare_capture(const std::filesystem::path& input, const std::filesystem::path& capture,
                     const PrepareOptions& options, const ProgressCallbacks& callbacks,
                     const std::atomic<bool>& stop);

// The folder for the intermediate results of a capture's steps.
std::filesystem::path work_folder(const std::filesystem::path& capture);

}  // namespace traceflow::prepare

#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "prepare/options.h"

namespace traceflow::prepare {

// Whoever waits for a preparation.
struct ProgressCallbacks {
  // What a step found, one line for each.
  std::function<void(const std::string& line)> found;
  // How much a step at work has done; 0 of 0 when it begins. all is 0 where it is not known.
  std::function<void(Step step, int64_t done, int64_t all)> at_work = [](Step, int64_t, int64_t) {};
};

// Makes a capture of a film or a folder of pictures (docs/prepare.md), with the programs ffmpeg and colmap.
// What the steps leave lies in CAPTURE.prepare, so that a later call goes on where this one ends. False where
// `stop` turned true before the end. Throws InputError.
bool prepare_capture(const std::filesystem::path& input, const std::filesystem::path& capture,
                     const PrepareOptions& options, const ProgressCallbacks& callbacks,
                     const std::atomic<bool>& stop);

// Where the steps of a capture leave what they made.
std::filesystem::path work_folder(const std::filesystem::path& capture);

}  // namespace traceflow::prepare

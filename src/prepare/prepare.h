#pragma once

#include <atomic>
#include <filesystem>

#include "prepare/options.h"
#include "prepare/steps.h"

namespace traceflow::prepare {

// Makes a capture of a film or a folder of pictures (docs/prepare.md), with the programs ffmpeg and colmap.
// What the steps leave lies in CAPTURE.prepare, so that a later call goes on where this one ends. `say` gets
// one line per step. False where `stop` turned true before the end. Throws InputError.
bool prepare_capture(const std::filesystem::path& input, const std::filesystem::path& capture,
                     const PrepareOptions& options, const Steps::Say& say, const std::atomic<bool>& stop);

// Where the steps of a capture leave what they made.
std::filesystem::path work_folder(const std::filesystem::path& capture);

}  // namespace traceflow::prepare

#pragma once

#include <memory>

#include "capture/formats/found_capture.h"

namespace traceflow {

// Selects the reader by the files in the folder and reads the capture. Throws InputError.
FoundCapture read_capture(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);

}  // namespace traceflow

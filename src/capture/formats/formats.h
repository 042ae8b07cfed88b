#pragma once

#include <memory>

#include "capture/formats/found_capture.h"

namespace traceflow {

// Reads a capture by the reader that knows its format, chosen by what lies in the folder. Throws InputError.
FoundCapture read_capture(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);

}  // namespace traceflow

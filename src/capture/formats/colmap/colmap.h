#pragma once

#include <memory>

#include "capture/formats/found_capture.h"

namespace traceflow {

// A COLMAP model in sparse/0, sparse or the folder itself. Photographs are in images (images_2, images_4, …
// at lower sizes), input, rgb or the folder itself.
bool is_colmap(const FileTree& tree);
// Throws InputError.
FoundCapture read_colmap(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);

}  // namespace traceflow

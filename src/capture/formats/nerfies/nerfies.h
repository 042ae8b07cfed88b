#pragma once

#include <memory>

#include "capture/formats/found_capture.h"

namespace traceflow {

// The layout of Nerfies, HyperNeRF and NeRF-DS: dataset.json, metadata.json, scene.json, camera/ID.json and
// rgb/Kx/ID.png.
bool is_nerfies(const FileTree& tree);
// Throws InputError.
FoundCapture read_nerfies(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);
// Reads DyCheck's captures, whose splits differ (capture/formats/nerfies/dycheck.h). Throws InputError.
FoundCapture read_dycheck(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);

}  // namespace traceflow

#pragma once

#include <memory>

#include "capture/formats/found_capture.h"

namespace traceflow {

// transforms.json, or transforms_train.json with transforms_test.json: NeRF-synthetic, D-NeRF, instant-ngp
// and nerfstudio (docs/captures.md).
bool is_transforms(const FileTree& tree);
// Throws InputError.
FoundCapture read_transforms(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);

}  // namespace traceflow

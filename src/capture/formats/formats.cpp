#include "capture/formats/formats.h"

#include "base/error.h"
#include "capture/formats/nerfies.h"

namespace traceflow {

FoundCapture read_capture(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  if (is_nerfies(*tree)) return read_nerfies(tree, options);
  throw InputError(tree->path().string(), "dataset.json", "no such file",
                   "a capture in the NeRF-DS, Nerfies or HyperNeRF layout", "see docs/captures.md");
}

}  // namespace traceflow

#include "capture/formats/formats.h"

#include <array>

#include "base/error.h"
#include "capture/formats/colmap.h"
#include "capture/formats/dycheck.h"
#include "capture/formats/nerfies.h"
#include "capture/formats/transforms.h"

namespace traceflow {

namespace {

// By what lies at the top. COLMAP goes before transforms.json, which programs write beside a model, because
// it has points.
CaptureFormat look(const FileTree& tree) {
  if (is_dycheck(tree)) return CaptureFormat::dycheck;
  if (is_nerfies(tree)) return CaptureFormat::nerfies;
  if (is_colmap(tree)) return CaptureFormat::colmap;
  if (is_transforms(tree)) return CaptureFormat::transforms;
  throw InputError(tree.path().string(), "", "no capture",
                   "dataset.json (Nerfies, HyperNeRF, NeRF-DS), splits/train.json (DyCheck), sparse/0 with "
                   "cameras and images (COLMAP), transforms.json or transforms_train.json",
                   "see docs/captures.md");
}

}  // namespace

FoundCapture read_capture(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  const bool automatic = options.format == CaptureFormat::automatic;
  const CaptureFormat format = automatic ? look(*tree) : options.format;
  if (format == CaptureFormat::transforms) return read_transforms(tree, options);
  if (format != CaptureFormat::colmap) return read_nerfies(tree, options);
  FoundCapture found = read_colmap(tree, options);
  if (automatic && is_transforms(*tree)) {
    found.warnings.emplace_back("transforms.json lies there too: --format transforms reads it",
                                "other-format", Severity::notice);
  }
  return found;
}

}  // namespace traceflow

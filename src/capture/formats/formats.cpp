#include "capture/formats/formats.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "capture/formats/colmap/colmap.h"
#include "capture/formats/image_names.h"
#include "capture/formats/nerfies/dycheck.h"
#include "capture/formats/nerfies/nerfies.h"
#include "capture/formats/transforms/transforms.h"
#include "capture/formats/unregistered.h"

namespace traceflow {

namespace {

struct Format {
  CaptureFormat name;
  bool (*lies_in)(const FileTree& tree);
  FoundCapture (*read)(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options);
};

// In order of precedence. COLMAP precedes transforms.json, which programs write beside a model, because it
// has points.
constexpr std::array<Format, 4> formats = {{{CaptureFormat::dycheck, is_dycheck, read_dycheck},
                                            {CaptureFormat::nerfies, is_nerfies, read_nerfies},
                                            {CaptureFormat::colmap, is_colmap, read_colmap},
                                            {CaptureFormat::transforms, is_transforms, read_transforms}}};

const Format& format_called(CaptureFormat name) { return *std::ranges::find(formats, name, &Format::name); }

// Selects the format by the files at the top.
const Format& look(const FileTree& tree) {
  const auto* const found = std::ranges::find_if(formats, [&](const Format& f) { return f.lies_in(tree); });
  if (found != formats.end()) return *found;
  // Other programs write files of this name too. Without the others it is an incomplete capture.
  if (tree.has("metadata.json")) return format_called(CaptureFormat::nerfies);
  throw InputError(tree.path().string(), "", "no capture",
                   "dataset.json (Nerfies, HyperNeRF, NeRF-DS), splits/train.json (DyCheck), sparse/0 with "
                   "cameras and images (COLMAP), transforms.json or transforms_train.json",
                   "see docs/captures.md");
}

// Applies the requested times, or else the format's default.
void settle_times(CaptureTimes asked, const std::vector<std::string>& unregistered, FoundCapture& found) {
  if (asked != CaptureTimes::automatic) found.times = asked;
  if (found.times == CaptureTimes::automatic) return;
  std::vector<FoundView*> views;
  std::vector<std::string> paths;
  for (auto* split : {&found.train, &found.test}) {
    for (FoundView& view : *split) {
      view.time = 0;
      views.push_back(&view);
      paths.push_back(view.image.path);
    }
  }
  if (found.times == CaptureTimes::none) return;
  std::vector<std::string> others = unregistered;
  others.insert(others.end(), found.listed_images.begin(), found.listed_images.end());
  const std::vector<double> places = times_by_names(paths, others);
  for (size_t i = 0; i < views.size(); ++i) views[i]->time = places[i];
}

void warn_about_unregistered(std::vector<std::string> files, std::vector<Finding>& warnings) {
  if (files.empty()) return;
  warnings
      .emplace_back(std::to_string(files.size()) + (files.size() == 1 ? " image has" : " images have") +
                        " no camera (" + ids_text(files) + ")",
                    "unregistered-image", Severity::notice)
      .files = std::move(files);
}

}  // namespace

FoundCapture read_capture(const std::shared_ptr<const FileTree>& tree, const CaptureOptions& options) {
  const bool automatic = options.format == CaptureFormat::automatic;
  const Format& format = automatic ? look(*tree) : format_called(options.format);
  FoundCapture found = format.read(tree, options);
  if (automatic && format.name == CaptureFormat::colmap && is_transforms(*tree)) {
    found.warnings.emplace_back("transforms.json lies there too: --format transforms reads it",
                                "other-format", Severity::notice);
  }
  std::vector<std::string> unregistered = unregistered_images(*tree, found);
  settle_times(options.times, unregistered, found);
  warn_about_unregistered(std::move(unregistered), found.warnings);
  return found;
}

}  // namespace traceflow

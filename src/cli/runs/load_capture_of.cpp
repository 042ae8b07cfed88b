#include "cli/runs/load_capture_of.h"

#include <iostream>

namespace traceflow::cli {

namespace {

template <class Source>
Capture load(const Source& source, const std::filesystem::path& folder, int downscale) {
  std::string warning;
  Capture capture = capture_of(source, folder, downscale, warning);
  if (!warning.empty()) std::cerr << warning << std::endl;
  return capture;
}

}  // namespace

Capture load_capture_of(const TrainedRun& run, const std::filesystem::path& folder, int downscale) {
  return load(run, folder, downscale);
}
Capture load_capture_of(const LoadedScene& scene, const std::filesystem::path& folder, int downscale) {
  return load(scene, folder, downscale);
}

}  // namespace traceflow::cli

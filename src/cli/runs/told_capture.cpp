#include "cli/runs/told_capture.h"

#include <iostream>

namespace traceflow::cli {

namespace {

template <class Source>
Capture told(const Source& source, const std::filesystem::path& folder, int downscale) {
  std::string warning;
  Capture capture = capture_of(source, folder, downscale, warning);
  if (!warning.empty()) std::cerr << warning << std::endl;
  return capture;
}

}  // namespace

Capture told_capture(const TrainedRun& run, const std::filesystem::path& folder, int downscale) {
  return told(run, folder, downscale);
}
Capture told_capture(const LoadedScene& scene, const std::filesystem::path& folder, int downscale) {
  return told(scene, folder, downscale);
}

}  // namespace traceflow::cli

#include "capture/formats/found_capture.h"

#include <algorithm>

#include "base/error.h"

namespace traceflow {

std::vector<std::string> keep_whole(const std::vector<std::string>& ids, const std::string& split,
                                    const std::string& what,
                                    const std::function<bool(const std::string& id)>& exists,
                                    std::vector<Finding>& warnings, const std::string& kind,
                                    const std::function<std::string(const std::string& id)>& path_of) {
  std::vector<std::string> kept, missing;
  for (const std::string& id : ids) (exists(id) ? kept : missing).push_back(id);
  if (!missing.empty()) {
    Finding& finding =
        warnings.emplace_back(std::to_string(missing.size()) + " of " + std::to_string(ids.size()) + " " +
                                  split + " views have no " + what + " (" + ids_text(missing) + "): left out",
                              kind);
    if (path_of) std::ranges::transform(missing, std::back_inserter(finding.files), path_of);
    finding.views = std::move(missing);
  }
  return kept;
}

int fitting_scale(int downscale, const IsStored& is_stored) {
  for (int stored = downscale; stored >= 1; --stored) {
    if (downscale % stored == 0 && is_stored(stored)) return stored;
  }
  return 0;
}

std::vector<int> stored_scales(const IsStored& is_stored) {
  constexpr int largest = 64;
  std::vector<int> scales;
  for (int stored = 1; stored <= largest; ++stored) {
    if (is_stored(stored)) scales.push_back(stored);
  }
  return scales;
}

StoredImages choose_images(const std::string& where, int downscale, const IsStored& is_stored,
                           const StoredFolder& folder_of) {
  const int stored = fitting_scale(downscale, is_stored);
  if (stored > 0) return {folder_of(stored), stored, downscale / stored};
  std::string found;
  for (const int scale : stored_scales(is_stored)) found += (found.empty() ? "" : ", ") + folder_of(scale);
  throw InputError(where, "", found.empty() ? "no images" : found,
                   "images at full size or at a divisor of the downscale (" + std::to_string(downscale) + ")",
                   found.empty() ? "" : "use a --downscale that the folder has");
}

}  // namespace traceflow

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
    if (path_of) std::transform(missing.begin(), missing.end(), std::back_inserter(finding.files), path_of);
    finding.views = std::move(missing);
  }
  return kept;
}

StoredImages choose_images(const FileTree& tree, int downscale,
                           const std::function<std::string(int stored)>& folder_of) {
  for (int stored = downscale; stored >= 1; --stored) {
    if (downscale % stored == 0 && tree.has_folder(folder_of(stored))) {
      return {folder_of(stored), stored, downscale / stored};
    }
  }
  constexpr int largest = 64;
  std::string found;
  for (int stored = 1; stored <= largest; ++stored) {
    if (tree.has_folder(folder_of(stored))) found += (found.empty() ? "" : ", ") + folder_of(stored);
  }
  throw InputError(tree.name_of(folder_of(1)), "", found.empty() ? "no images" : found,
                   "images at full size or at a divisor of the downscale (" + std::to_string(downscale) + ")",
                   found.empty() ? "" : "use a --downscale that the folder has");
}

}  // namespace traceflow

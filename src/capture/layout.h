#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace traceflow {

// What a capture folder's JSON files say about all of its views (docs/captures.md).
struct CaptureLayout {
  std::string format;
  std::vector<std::string> all_ids, train_ids, test_ids;  // in the file's order, each id once
  std::map<std::string, double> time_id;                  // of the ids that metadata.json knows
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;
};

// Reads dataset.json, metadata.json and scene.json; adds what looks wrong to `warnings`. Throws InputError.
CaptureLayout read_layout(const std::filesystem::path& folder, std::vector<std::string>& warnings);

// "3 of 80 training views have no image (a, b, c): left out" from the ids concerned; at most three are named.
std::string ids_text(const std::vector<std::string>& ids);

}  // namespace traceflow

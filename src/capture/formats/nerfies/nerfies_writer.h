#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "math/camera.h"
#include "scene/normalisation.h"

// The JSON files of the layout of Nerfies, HyperNeRF and NeRF-DS (docs/captures.md).
namespace traceflow {

struct NerfiesView {
  std::string id;
  Camera<double> camera;  // in the capture's own coordinates
  int64_t time = 0;       // time_id, in any unit
  int64_t order = 0;      // warp_id and appearance_id
  int camera_id = 0;
  bool is_test = false;
};

struct NerfiesScene {
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;  // scene units; 0: unknown
};

// Writes camera/ID.json, metadata.json, scene.json and, last, dataset.json. The folder must have a folder
// `camera`.
void write_nerfies_layout(const std::filesystem::path& folder, const std::vector<NerfiesView>& views,
                          const NerfiesScene& scene);

}  // namespace traceflow

#pragma once

#include <map>
#include <string>
#include <vector>

#include "capture/formats/finding.h"
#include "files/file_tree.h"
#include "files/json_document.h"
#include "scene/normalisation.h"

namespace traceflow {

// What the JSON files in the layout of Nerfies, HyperNeRF and NeRF-DS define for all views
// (docs/captures.md).
struct NerfiesLayout {
  std::string format;
  bool transparent_is_unknown = false;                    // as in FoundCapture
  std::vector<std::string> all_ids, train_ids, test_ids;  // in file order, each id once
  std::map<std::string, double> time_id;                  // of the ids that have one in metadata.json
  std::map<std::string, std::string> rig_camera;          // camera_id, of the ids that have one
  SceneNormalisation normalisation;
  double near_plane = 0, far_plane = 0;
};

// Ids become part of file names and must not lead out of the folder. Throws InputError for others.
void check_capture_id(const JsonField& field, const std::string& id);
// Reads normalisation and planes from scene.json. Throws InputError.
void read_nerfies_scene(const FileTree& tree, NerfiesLayout& layout);

// Reads dataset.json, metadata.json and scene.json. Adds warnings. Throws InputError.
NerfiesLayout read_nerfies_layout(const FileTree& tree, std::vector<Finding>& warnings);

}  // namespace traceflow

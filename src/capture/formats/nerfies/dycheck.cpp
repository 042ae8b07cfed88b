#include "capture/formats/nerfies/dycheck.h"

#include <set>

#include "base/error.h"
#include "files/json_document.h"

namespace traceflow {

namespace {

constexpr const char* train_split = "splits/train.json";
constexpr const char* test_split = "splits/val.json";

std::vector<std::string> read_split(const FileTree& tree, const char* path, NerfiesLayout& layout,
                                    std::set<std::string>& seen) {
  const JsonFile split(tree.open_file(path));
  const std::vector<JsonField> names = split["frame_names"].elements();
  const std::vector<JsonField> times = split["time_ids"].elements(names.size());
  std::vector<JsonField> cameras;
  if (split.has("camera_ids")) cameras = split["camera_ids"].elements(names.size());
  std::vector<std::string> ids;
  for (size_t i = 0; i < names.size(); ++i) {
    ids.push_back(names[i].text());
    check_capture_id(names[i], ids.back());
    if (!seen.insert(ids.back()).second) names[i].fail(ids.back() + " a second time", "each frame once");
    layout.time_id[ids.back()] = times[i].number(0, 1e12);
    if (!cameras.empty()) layout.rig_camera[ids.back()] = std::to_string(cameras[i].whole(0, 1000000));
  }
  layout.all_ids.insert(layout.all_ids.end(), ids.begin(), ids.end());
  return ids;
}

}  // namespace

bool is_dycheck(const FileTree& tree) { return tree.has(train_split); }

NerfiesLayout read_dycheck_layout(const FileTree& tree, std::vector<Finding>& warnings) {
  for (const char* name : {train_split, "scene.json"}) {
    if (tree.has(name)) continue;
    throw InputError(tree.path().string(), name, "no such file", "a capture in the DyCheck layout",
                     "see docs/captures.md");
  }
  NerfiesLayout layout;
  layout.format = "dycheck";
  // Training images are points of a depth camera. Where it has no data they are black and transparent.
  layout.transparent_is_unknown = true;
  std::set<std::string> seen;
  layout.train_ids = read_split(tree, train_split, layout, seen);
  if (layout.train_ids.empty()) {
    const JsonFile split(tree.open_file(train_split));
    split["frame_names"].fail("an empty list", "the frames to train on", "list them");
  }
  if (tree.has(test_split)) {
    layout.test_ids = read_split(tree, test_split, layout, seen);
  } else {
    warnings.emplace_back("splits/val.json is missing: there is nothing to evaluate on", "no-test",
                          Severity::notice);
  }
  if (tree.has_folder("covisible"))
    warnings.emplace_back("covisible/ is not used", "not-used", Severity::notice);
  read_nerfies_scene(tree, layout);
  return layout;
}

}  // namespace traceflow

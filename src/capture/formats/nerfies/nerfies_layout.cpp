#include "capture/formats/nerfies/nerfies_layout.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/printable.h"
#include "capture/formats/found_capture.h"
#include "files/json_document.h"

namespace traceflow {

namespace {

std::vector<std::string> read_ids(const JsonFile& dataset, const std::string& key,
                                  std::vector<Finding>& warnings) {
  if (!dataset.has(key)) return {};
  const JsonField field = dataset[key];
  std::vector<std::string> kept, repeated;
  std::set<std::string> seen;
  for (const std::string& id : field.strings()) {
    check_capture_id(field, id);
    (seen.insert(id).second ? kept : repeated).push_back(id);
  }
  if (!repeated.empty()) {
    warnings
        .emplace_back("dataset.json: " + key + " names " + ids_text(repeated) + " more than once: used once",
                      "repeated-id")
        .views = repeated;
  }
  return kept;
}

// HyperNeRF's interpolation split: of every four frames the first trains and the third tests.
void split_for_interpolation(NerfiesLayout& layout) {
  const std::vector<std::string>& ids = layout.all_ids.empty() ? layout.train_ids : layout.all_ids;
  std::vector<std::string> train, test;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (i % 4 == 0) train.push_back(ids[i]);
    if (i % 4 == 2) test.push_back(ids[i]);
  }
  layout.all_ids = ids;
  layout.train_ids = std::move(train);
  layout.test_ids = std::move(test);
}

void read_split(const FileTree& tree, NerfiesLayout& layout, std::vector<Finding>& warnings) {
  const JsonFile dataset(tree.open_file("dataset.json"));
  layout.all_ids = read_ids(dataset, "ids", warnings);
  layout.train_ids = read_ids(dataset, "train_ids", warnings);
  layout.test_ids = read_ids(dataset, "val_ids", warnings);
  if (layout.all_ids.empty() && layout.train_ids.empty()) {
    dataset.fail("no ids", "train_ids and val_ids, or ids");
  }
  // Otherwise the split of `ids` would train on the test views.
  if (layout.train_ids.empty() && dataset.has("train_ids")) {
    dataset["train_ids"].fail("an empty list", "the ids of the views to train on",
                              layout.all_ids.empty()
                                  ? "list them"
                                  : "list them, or take train_ids and val_ids away, and ids is split");
  }
  if (layout.train_ids.empty() || layout.test_ids.empty()) {
    layout.format = "hypernerf-interp";
    split_for_interpolation(layout);
    if (layout.test_ids.empty())
      warnings.emplace_back("too few views for a test split: there is nothing to evaluate on", "no-test",
                            Severity::notice);
    return;
  }
  const std::set<std::string> train(layout.train_ids.begin(), layout.train_ids.end());
  std::vector<std::string> both;
  std::ranges::copy_if(layout.test_ids, std::back_inserter(both),
                       [&](const std::string& id) { return train.contains(id); });
  if (!both.empty()) {
    warnings
        .emplace_back(
            "dataset.json: " + ids_text(both) + " in train_ids and in val_ids: the test is of trained views",
            "id-in-both-splits")
        .views = both;
  }
}

bool has_sides(const std::vector<std::string>& ids, const std::string& side) {
  return std::ranges::any_of(ids, [&](const std::string& id) { return id.ends_with(side); });
}

// The formats differ in what they leave out. Only the name depends on this.
std::string format_of(const FileTree& tree, const NerfiesLayout& layout, bool has_time_ids) {
  if (!layout.format.empty()) return layout.format;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(tree.path());
  const std::string parent = whole.parent_path().filename().string(), name = whole.filename().string();
  if (parent.starts_with("vrig") || name.starts_with("vrig")) return "hypernerf-vrig";
  if (has_sides(layout.train_ids, "_left") || has_sides(layout.test_ids, "_right") ||
      tree.has_folder("resized_mask") || tree.has_folder("mask")) {
    return "nerf-ds";
  }
  return has_time_ids ? "hypernerf-vrig" : "nerfies";
}

void read_times(const FileTree& tree, NerfiesLayout& layout, std::vector<Finding>& warnings) {
  const JsonFile metadata(tree.open_file("metadata.json"));
  if (!metadata.json().is_object()) metadata.expect("an object");
  bool has_time_ids = false;
  std::set<std::string> ids(layout.train_ids.begin(), layout.train_ids.end());
  ids.insert(layout.test_ids.begin(), layout.test_ids.end());
  std::vector<std::string> by_warp;
  for (const std::string& id : ids) {
    if (!metadata.has(id)) continue;
    const JsonField entry = metadata[id];
    // A view without a time is left out. A null time, or an entry that is not an object, is an error.
    const nlohmann::json& said = entry.json();
    if (said.is_object() && !said.contains("time_id") && !said.contains("warp_id")) continue;
    const bool has_time = entry.has("time_id");
    const JsonField field = has_time ? entry["time_id"] : entry["warp_id"];
    if (field.number() < 0) field.expect("a number of at least zero");
    layout.time_id[id] = field.number();
    if (entry.has("camera_id") && entry["camera_id"].json().is_primitive())
      layout.rig_camera[id] = entry["camera_id"].json().dump();
    has_time_ids |= has_time;
    if (!has_time) by_warp.push_back(id);
  }
  if (has_time_ids && !by_warp.empty()) {
    warnings
        .emplace_back("metadata.json: no time_id for " + ids_text(by_warp) + ": warp_id taken in its place",
                      "no-time-id")
        .views = by_warp;
  }
  layout.format = format_of(tree, layout, has_time_ids);
}

}  // namespace

void check_capture_id(const JsonField& field, const std::string& id) {
  constexpr size_t longest = 200;
  if (id.empty() || id.find('/') != std::string::npos || id == "." || id == ".." ||
      printable(id, longest) != id) {
    field.fail("the id \"" + printable(id, 60) + "\"", "ids that can name a file");
  }
}

void read_nerfies_scene(const FileTree& tree, NerfiesLayout& layout) {
  const JsonFile scene(tree.open_file("scene.json"));
  layout.normalisation.centre = scene["center"].vector();
  // Limits lengths to what single precision can hold on both sides of the scaling.
  constexpr double largest = 1e12;
  scene["scale"].positive();
  layout.normalisation.scale = scene["scale"].number(1 / largest, largest);
  if (scene.has("near")) layout.near_plane = scene["near"].number(-largest, largest);
  if (scene.has("far")) layout.far_plane = scene["far"].number(-largest, largest);
  if (scene.has("near") && scene.has("far") && !(layout.far_plane > layout.near_plane)) {
    scene["far"].expect("more than near (" + scene["near"].json().dump() + ")");
  }
}

NerfiesLayout read_nerfies_layout(const FileTree& tree, std::vector<Finding>& warnings) {
  for (const char* name : {"dataset.json", "metadata.json", "scene.json"}) {
    if (tree.has(name)) continue;
    throw InputError(tree.path().string(), name, "no such file",
                     "a capture in the NeRF-DS, Nerfies or HyperNeRF layout", "see docs/captures.md");
  }
  NerfiesLayout layout;
  read_split(tree, layout, warnings);
  read_times(tree, layout, warnings);
  read_nerfies_scene(tree, layout);
  return layout;
}

}  // namespace traceflow

#include "capture/formats/transforms/transforms_file.h"

#include "base/error.h"
#include "capture/formats/image_names.h"

namespace traceflow {

namespace {

std::vector<std::string> paths_of(const JsonField& file, const char* key) {
  std::vector<std::string> paths;
  if (!file.has(key)) return paths;
  for (const std::string& path : file[key].strings()) paths.push_back(tidy_path(path));
  return paths;
}

TransformsFrame read_frame(const std::string& file, const JsonField& json, const TransformsLens& common) {
  TransformsFrame frame;
  frame.file = file;
  frame.json = std::make_shared<JsonField>(json);
  frame.path = tidy_path(json["file_path"].text());
  frame.lens = common;
  frame.lens.take(json);
  frame.pose = read_transform_matrix(json["transform_matrix"]);
  if (json.has("time")) frame.time = json["time"].number(-1e12, 1e12);
  return frame;
}

}  // namespace

TransformsFile read_transforms_file(const FileTree& tree, const std::string& path) {
  TransformsFile file;
  file.json = std::make_shared<JsonFile>(tree.open_file(path));
  const JsonField& json = *file.json;
  TransformsLens common;
  common.take(json);
  for (const JsonField& field : json["frames"].elements()) {
    file.frames.push_back(read_frame(tree.name_of(path), field, common));
    file.masks += field.has("mask_path") ? 1 : 0;
    file.depths += field.has("depth_file_path") || field.has("depth_path") ? 1 : 0;
  }
  file.train = paths_of(json, "train_filenames");
  file.test = paths_of(json, "test_filenames");
  if (file.test.empty()) file.test = paths_of(json, "val_filenames");
  if (json.has("ply_file_path")) file.points = tidy_path(json["ply_file_path"].text());
  file.is_nerfstudio = json.has("camera_model") || json.has("ply_file_path") || !file.train.empty() ||
                       json.has("applied_transform");
  return file;
}

std::vector<std::string> list_frames(const FileTree& tree, const std::string& path) {
  try {
    const JsonFile json(tree.open_file(path));
    std::vector<std::string> paths;
    for (const JsonField& field : json["frames"].elements())
      paths.push_back(tidy_path(field["file_path"].text()));
    return paths;
  } catch (const InputError&) {
    return {};
  }
}

}  // namespace traceflow

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/formats/transforms_camera.h"
#include "files/file_tree.h"

namespace traceflow {

struct TransformsFrame {
  std::string path;  // as written, "/" between folders
  TransformsLens lens;
  TransformsPose pose;
  std::optional<double> time;
  std::shared_ptr<const JsonField> json;
};

// One of a capture's JSON files.
struct TransformsFile {
  std::vector<TransformsFrame> frames;
  std::vector<std::string> train, test;  // paths, where the file splits its frames
  std::string points;                    // a .ply's path; empty where it names none
  bool is_nerfstudio = false;
  int masks = 0, depths = 0;  // frames that name such files
  std::shared_ptr<const JsonFile> json;
};

// Throws InputError naming file, field and value.
TransformsFile read_transforms_file(const FileTree& tree, const std::string& path);

}  // namespace traceflow

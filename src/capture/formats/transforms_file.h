#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/formats/transforms_camera.h"
#include "files/file_tree.h"

namespace traceflow {

struct TransformsFrame {
  std::string file;  // that it stands in, as errors call it
  std::string path;  // of its image as written, "/" between folders
  TransformsLens lens;
  TransformsPose pose;
  std::optional<double> time;
  std::optional<bool> is_test;  // where the files split their frames
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

// The paths of a file's frames, where it is one of this kind; of one that is not, none.
std::vector<std::string> list_frames(const FileTree& tree, const std::string& path);

}  // namespace traceflow

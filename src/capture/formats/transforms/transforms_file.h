#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/formats/transforms/transforms_camera.h"
#include "files/file_tree.h"

namespace traceflow {

struct TransformsFrame {
  std::string file;  // the file that defines it, for errors
  std::string path;  // of its image as written, with "/" as separator
  TransformsLens lens;
  TransformsPose pose;
  std::optional<double> time;
  std::optional<bool> is_test;  // set if the files define a split
  std::shared_ptr<const JsonField> json;
};

// One of a capture's JSON files.
struct TransformsFile {
  std::vector<TransformsFrame> frames;
  std::vector<std::string> train, test;  // paths, if the file defines a split
  std::string points;                    // a .ply's path; empty if none is named
  bool is_nerfstudio = false;
  int masks = 0, depths = 0;  // number of frames that name such files
  std::shared_ptr<const JsonFile> json;
};

// Throws InputError with file, field and value.
TransformsFile read_transforms_file(const FileTree& tree, const std::string& path);

// The paths of the file's frames; empty if it is not a file of this kind.
std::vector<std::string> list_frames(const FileTree& tree, const std::string& path);

}  // namespace traceflow

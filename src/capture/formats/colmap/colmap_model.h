#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "capture/lens/lens.h"
#include "files/file_tree.h"
#include "math/types.h"

// A COLMAP reconstruction in its own coordinates: camera axes x right, y down, z forward.
namespace traceflow {

struct ColmapCamera {
  int64_t id = 0;
  std::string model;
  Lens lens;
};

struct ColmapImage {
  int64_t id = 0;
  int64_t camera_id = 0;
  std::string name;  // relative to the folder of images
  Mat3<double> camera_from_world{1};
  Vec3<double> position{0};  // of the camera, in world
  int64_t points_seen = 0;
};

struct ColmapPoint {
  Vec3<double> position{0};
  Vec3<uint8_t> colour{0};
  double error = 0;  // pixels, as stored in the file
  int64_t track_length = 0;
};

struct ColmapModel {
  std::vector<ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::vector<ColmapPoint> points;
  std::string cameras_file, images_file, points_file;  // paths in the tree; the last may be empty

  // Null if there is no such camera.
  const ColmapCamera* camera(int64_t id) const;
};

// Whether the folder has a model's files, binary or text.
bool has_colmap_model(const FileTree& tree, const std::string& folder);

// Reads cameras, images and points3D, from .bin if it exists, else from .txt. All are sorted by id. Rigs and
// frames are not needed, since images have poses. Without points3D there are no points. Throws InputError
// with file, field and value for files that are truncated or promise more than they hold, models that Lens
// cannot represent, repeated ids or image names, missing cameras, numbers that are not finite, and zero
// quaternions.
ColmapModel read_colmap_model(const FileTree& tree, const std::string& folder);

}  // namespace traceflow

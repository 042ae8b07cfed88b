#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "files/input_file.h"
#include "files/limits.h"
#include "math/types.h"

// The rows of a COLMAP model's files, in file order; only their syntax is checked. The readers throw
// InputError for files that are truncated or malformed, and for more than `most` points. They check that the
// file can hold the promised rows before they allocate memory for them.
namespace traceflow {

struct ColmapCameraRow {
  int64_t id = 0;
  std::string model;  // its name, or its number if the name is unknown
  double width = 0, height = 0;
  std::vector<double> parameters;
};

struct ColmapImageRow {
  int64_t id = 0;
  std::array<double, 4> quaternion{};  // w, x, y, z
  Vec3<double> translation{0};
  int64_t camera_id = 0;
  std::string name;
  int64_t points_seen = 0;
};

struct ColmapPointRow {
  int64_t id = 0;
  Vec3<double> position{0};
  Vec3<uint8_t> colour{0};
  double error = 0;
  int64_t track_length = 0;
};

std::vector<ColmapCameraRow> read_colmap_cameras_binary(const InputFile& file);
std::vector<ColmapImageRow> read_colmap_images_binary(const InputFile& file);
std::vector<ColmapPointRow> read_colmap_points_binary(const InputFile& file,
                                                      int64_t most = max_capture_points);

std::vector<ColmapCameraRow> read_colmap_cameras_text(const InputFile& file);
std::vector<ColmapImageRow> read_colmap_images_text(const InputFile& file);
std::vector<ColmapPointRow> read_colmap_points_text(const InputFile& file, int64_t most = max_capture_points);

}  // namespace traceflow

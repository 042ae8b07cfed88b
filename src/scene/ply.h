#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "scene/scene.h"

// The .ply of 2DGS: one vertex per surfel, stored values before activation (method §1.1), binary little
// endian.
namespace traceflow {

struct PlyScene {
  Surfels surfels;
  // Header lines "comment traceflow KEY VALUE": what the attributes cannot express.
  std::map<std::string, std::string> notes;
};

// Reads x y z, f_dc_0..2, f_rest_* (all red first, then green, then blue; 0, 9, 24 or 45 of them), opacity
// (logit), scale_0 scale_1 (log), rot_0..3 (w first) and, if present, tint and roughness (logits). Each is
// found by its name, in any order and of any scalar type. Other properties and elements after the vertices
// are ignored. Throws InputError for any other file: ASCII, big endian, a list among the properties, three
// scales (3DGS), or fewer bytes than the header promises. Values are not checked: rendering skips a surfel
// with a value that is not finite.
PlyScene read_ply(const std::filesystem::path& path);

// Writes x y z nx ny nz (zeros) f_dc_* f_rest_* opacity scale_0 scale_1 rot_0..3 [tint] [roughness], float32,
// atomically.
void write_ply(const std::filesystem::path& path, const PlyScene& scene);

// Converts positions and log-scales from the normalised scene to the capture's own coordinates (method §2).
void undo_normalisation(const SceneNormalisation& normalisation, Surfels& surfels);

}  // namespace traceflow

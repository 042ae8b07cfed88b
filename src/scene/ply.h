#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "scene/scene.h"

// The .ply of 2DGS: one vertex a surfel, stored values before activation (method §1.1), in binary little
// endian.
namespace traceflow {

struct PlyScene {
  Surfels surfels;
  // Header lines "comment traceflow KEY VALUE": what the attributes cannot say.
  std::map<std::string, std::string> notes;
};

// Reads x y z, f_dc_0..2, f_rest_* (all red first, then green, then blue; 0, 9, 24 or 45 of them), opacity
// (logit), scale_0 scale_1 (log), rot_0..3 (w first) and, where there are, tint and roughness (logits), each
// found by its name in any order and of any scalar type. Other properties and elements after the vertices are
// passed over. Throws InputError for what is not such a file: ASCII, big endian, a list among the properties,
// three scales (3DGS), or fewer bytes than the header promises. Values are not judged: a surfel with a value
// that is not finite is left out where it is drawn.
PlyScene read_ply(const std::filesystem::path& path);

// x y z nx ny nz (zeros) f_dc_* f_rest_* opacity scale_0 scale_1 rot_0..3 [tint] [roughness], float32.
// Written atomically.
void write_ply(const std::filesystem::path& path, const PlyScene& scene);

// Surfels from the normalised scene to the capture's own coordinates (method §2): positions and log-scales.
void undo_normalisation(const SceneNormalisation& normalisation, Surfels& surfels);

}  // namespace traceflow

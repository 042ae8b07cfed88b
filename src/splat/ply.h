#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "scene/scene.h"

// The .ply of 2DGS and of 3DGS: one vertex per surfel or Gaussian, stored values before activation (method
// §1.1), binary little endian.
namespace traceflow {

// What a vertex is: 3DGS's Gaussians have a third scale.
enum class PlyVertex { surfel, gaussian };

struct PlyScene {
  Surfels surfels;
  // Header lines "comment traceflow KEY VALUE": what the attributes cannot express.
  std::map<std::string, std::string> notes;
  PlyVertex vertex = PlyVertex::surfel;
};

// Reads x y z, f_dc_0..2, f_rest_* (all red first, then green, then blue; 0, 9, 24 or 45 of them), opacity
// (logit), scale_0 scale_1 (log), rot_0..3 (w first) and, if present, tint and roughness (logits). Each is
// found by its name, in any order and of any scalar type. With a scale_2, the vertices are Gaussians, which
// become surfels (splat/gaussians.h). Other properties and elements after the vertices are ignored. Throws
// InputError for any other file: ASCII, big endian, a list among the properties, or fewer bytes than the
// header promises. Values are not checked: rendering skips a surfel with a value that is not finite.
PlyScene read_ply(const std::filesystem::path& path);

// Writes x y z nx ny nz (zeros) f_dc_* f_rest_* opacity scale_0 scale_1 [scale_2] rot_0..3 [tint]
// [roughness], float32, atomically. The scale_2 of Gaussians is log_thickness.
void write_ply(const std::filesystem::path& path, const PlyScene& scene);

// Converts positions and log-scales from the normalised scene to the capture's own coordinates (method §2).
void undo_normalisation(const SceneNormalisation& normalisation, Surfels& surfels);

}  // namespace traceflow

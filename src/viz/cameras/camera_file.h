#pragma once

#include <filesystem>

#include "scene/normalisation.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// Reads the cameras.json of 3DGS and 2DGS: a list of {width, height, position, rotation (world_from_camera,
// rows), fx, fy} with, optionally, cx, cy (default: the image centre), time (0 to 1) and img_name (default:
// id, else the index in the list). A repeated img_name gets "_" and the id, or the index, appended. Lengths
// are in the capture's units; `normalisation` converts them to the scene's. Throws InputError with the camera
// and the field for missing or non-numeric values, invalid rotations, sizes above 32,768, times outside 0 to
// 1, names that would leave the output folder, and names that still collide in it.
std::vector<Shot> read_cameras(const std::filesystem::path& path, const SceneNormalisation& normalisation);

// Throws InputError unless the name stays inside its folder.
void check_name(const std::string& where, const std::string& field, const std::string& name);

}  // namespace traceflow::viz

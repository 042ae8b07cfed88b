#pragma once

#include <filesystem>

#include "scene/normalisation.h"
#include "viz/cameras/shot.h"

namespace traceflow::viz {

// The cameras.json of 3DGS and 2DGS: a list of {width, height, position, rotation (world_from_camera, rows),
// fx, fy} with, optionally, cx, cy (else the middle of the image), time (0 to 1) and img_name (else id, else
// the place in the list). An img_name that comes again gets "_" and the id, or the place, behind it. Lengths
// are the capture's own; `normalisation` takes them to the scene's. Throws InputError naming the camera and
// the field: for what is missing or not a number, for a rotation that is none, for sizes over 32,768, for a
// time outside 0 to 1, and for names that would leave the output folder or that meet each other in it even
// so.
std::vector<Shot> read_cameras(const std::filesystem::path& path, const SceneNormalisation& normalisation);

// Throws InputError unless the name stays inside the folder that it is put in.
void check_name(const std::string& where, const std::string& field, const std::string& name);

}  // namespace traceflow::viz

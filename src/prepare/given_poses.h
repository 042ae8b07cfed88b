#pragma once

#include <filesystem>
#include <string>

#include "base/work.h"
#include "prepare/pose_file.h"
#include "prepare/poses.h"

namespace traceflow::prepare {

// Writes a model with the cameras of the file and points of its depth maps where nothing moves, in COLMAP's
// text format, as the chosen one (poses.h). masks: ID.png each; may be incomplete or missing. Returns a text
// on the result. Throws InputError, also if hardly any depths agree, and Stopped.
std::string use_given_poses(const PoseFile& file, const Frames& frames, const std::filesystem::path& masks,
                            const PoseFolder& folder, const Work& work);

}  // namespace traceflow::prepare

#pragma once

#include "capture/formats/nerfies/nerfies_layout.h"

namespace traceflow {

// DyCheck's captures: the Nerfies layout, with the splits in splits/train.json and splits/val.json.
bool is_dycheck(const FileTree& tree);
// Reads the splits with their times, and scene.json. Throws InputError.
NerfiesLayout read_dycheck_layout(const FileTree& tree, std::vector<Finding>& warnings);

}  // namespace traceflow

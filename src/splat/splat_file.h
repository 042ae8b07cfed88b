#pragma once

#include "splat/ply.h"

namespace traceflow {

// Reads a .ply of 2DGS or 3DGS, or an .spz, by its first bytes. Throws InputError.
PlyScene read_splat_file(const std::filesystem::path& path);

}  // namespace traceflow

#pragma once

#include <vector>

#include "files/input_file.h"
#include "math/types.h"

namespace traceflow {

// Reads the positions x, y, z of the vertices, the first element of a .ply, in text or binary little endian.
// Throws InputError for other and for truncated files, and for more vertices than the file can hold.
std::vector<Vec3<double>> read_ply_points(const InputFile& file);

}  // namespace traceflow

#pragma once

#include <vector>

#include "files/input_file.h"
#include "math/types.h"

namespace traceflow {

// The positions x, y, z of a .ply's vertices, its first element, in text or binary little endian. Throws
// InputError for other files, for those cut short, and for more vertices than the file can hold.
std::vector<Vec3<double>> read_ply_points(const InputFile& file);

}  // namespace traceflow

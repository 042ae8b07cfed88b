#pragma once

#include <filesystem>

#include "mesh/mesh.h"

namespace traceflow::mesh {

// Writes a mesh as binary little-endian .ply, atomically: vertices with x y z nx ny nz (float) and red green
// blue (uchar, sRGB), faces with vertex_indices (list uchar int). Throws InputError if writing fails.
void write_mesh_ply(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace traceflow::mesh

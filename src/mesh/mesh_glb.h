#pragma once

#include <filesystem>

#include "mesh/mesh.h"

namespace traceflow::mesh {

// Writes a mesh as binary glTF 2.0, in the axes of files/glb_writer.h, atomically. Throws InputError if the
// mesh has no triangle, is larger than the format's 4 GiB, or cannot be written.
void write_mesh_glb(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace traceflow::mesh

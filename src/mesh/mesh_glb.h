#pragma once

#include <filesystem>

#include "mesh/mesh.h"

namespace traceflow::mesh {

// Writes a mesh as binary glTF 2.0, atomically. Captures have y down and z forward, glTF has y up: the root
// node turns the mesh by 180° about x, and its vertices stay in the capture's coordinates. Colours become
// linear, as glTF wants them, in 16 bits. The material is matt and has two sides. Throws InputError if the
// mesh has no triangle, is larger than the format's 4 GiB, or cannot be written.
void write_mesh_glb(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace traceflow::mesh

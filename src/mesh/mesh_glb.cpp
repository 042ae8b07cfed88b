#include "mesh/mesh_glb.h"

#include "base/error.h"
#include "files/glb_writer.h"

namespace traceflow::mesh {

void write_mesh_glb(const std::filesystem::path& path, const TriangleMesh& mesh) {
  if (mesh.triangle_count() == 0)
    throw InputError(path.string(), "", "a mesh without triangles", "at least one");
  GlbWriter writer(mesh.vertices);
  writer.set_normals(mesh.normals);
  writer.set_colours(mesh.colours);
  writer.write(path, GlbPrimitive::triangles, mesh.triangles);
}

}  // namespace traceflow::mesh

#include "mesh/mesh_ply.h"

#include <fmt/format.h>

#include <bit>
#include <string>

#include "base/atomic_file.h"
#include "files/eight_bit.h"

namespace traceflow::mesh {

namespace {

static_assert(std::endian::native == std::endian::little, "the file's byte order is the machine's");

template <class T>
void append_numbers(const T* numbers, int64_t count, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(numbers), static_cast<size_t>(count) * sizeof(T));
}

}  // namespace

void write_mesh_ply(const std::filesystem::path& path, const TriangleMesh& mesh) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment traceflow mesh\n";
  bytes += fmt::format("element vertex {}\n", mesh.vertex_count());
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"})
    bytes += fmt::format("property float {}\n", name);
  for (const char* name : {"red", "green", "blue"}) bytes += fmt::format("property uchar {}\n", name);
  bytes += fmt::format("element face {}\n", mesh.triangle_count());
  bytes += "property list uchar int vertex_indices\nend_header\n";
  bytes.reserve(bytes.size() + static_cast<size_t>(27 * mesh.vertex_count() + 13 * mesh.triangle_count()));
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    append_numbers(mesh.vertices.row(i), 3, bytes);
    append_numbers(mesh.normals.row(i), 3, bytes);
    for (int64_t c = 0; c < 3; ++c) bytes += static_cast<char>(to_8bit(mesh.colours(i, c)));
  }
  for (int64_t t = 0; t < mesh.triangle_count(); ++t) {
    bytes += '\3';
    append_numbers(mesh.triangles.row(t), 3, bytes);
  }
  write_atomically(path, bytes);
}

}  // namespace traceflow::mesh

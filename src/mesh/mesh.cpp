#include "mesh/mesh.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <vector>

namespace traceflow::mesh {

namespace {

// The vertex that represents the component of a vertex. Shortens the way for the next call.
int32_t root_of(std::vector<int32_t>& parent, int32_t vertex) {
  while (parent[static_cast<size_t>(vertex)] != vertex) {
    int32_t& above = parent[static_cast<size_t>(vertex)];
    above = parent[static_cast<size_t>(above)];
    vertex = above;
  }
  return vertex;
}

Tensor<float> chosen_rows(const Tensor<float>& rows, const std::vector<int32_t>& chosen) {
  Tensor<float> result(Shape{static_cast<int64_t>(chosen.size()), 3});
  for (size_t i = 0; i < chosen.size(); ++i)
    std::copy_n(rows.row(chosen[i]), 3, result.row(static_cast<int64_t>(i)));
  return result;
}

}  // namespace

TriangleMesh without_small_components(const TriangleMesh& mesh, int64_t keep, int64_t min_triangles) {
  const auto vertices = static_cast<size_t>(mesh.vertex_count());
  const int64_t triangles = mesh.triangle_count();
  std::vector<int32_t> root(vertices);
  std::iota(root.begin(), root.end(), 0);
  for (int64_t t = 0; t < triangles; ++t) {
    for (int64_t k = 1; k < 3; ++k) {
      const int32_t a = root_of(root, mesh.triangles(t, 0)), b = root_of(root, mesh.triangles(t, k));
      root[static_cast<size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  std::vector<int64_t> size(vertices, 0);
  for (int64_t t = 0; t < triangles; ++t) ++size[static_cast<size_t>(root_of(root, mesh.triangles(t, 0)))];

  int64_t least = min_triangles;
  std::vector<int64_t> sizes = size;
  if (keep > 0 && static_cast<size_t>(keep) <= sizes.size()) {
    const auto last = sizes.begin() + static_cast<std::ptrdiff_t>(keep - 1);
    std::nth_element(sizes.begin(), last, sizes.end(), std::greater<>());
    least = std::max(least, *last);
  }

  std::vector<int32_t> kept_vertices, kept_triangles, place(vertices, -1);
  const auto stays = [&](int32_t vertex) {
    const int64_t count = size[static_cast<size_t>(root_of(root, vertex))];
    return count > 0 && count >= least;
  };
  std::vector<uint8_t> used(vertices, 0);
  for (const int32_t vertex : mesh.triangles.values()) used[static_cast<size_t>(vertex)] = 1;
  for (size_t v = 0; v < vertices; ++v) {
    if (used[v] == 0 || !stays(static_cast<int32_t>(v))) continue;
    place[v] = static_cast<int32_t>(kept_vertices.size());
    kept_vertices.push_back(static_cast<int32_t>(v));
  }
  for (int64_t t = 0; t < triangles; ++t) {
    if (!stays(mesh.triangles(t, 0))) continue;
    for (int64_t k = 0; k < 3; ++k)
      kept_triangles.push_back(place[static_cast<size_t>(mesh.triangles(t, k))]);
  }

  TriangleMesh result;
  result.vertices = chosen_rows(mesh.vertices, kept_vertices);
  result.normals = chosen_rows(mesh.normals, kept_vertices);
  result.colours = chosen_rows(mesh.colours, kept_vertices);
  result.triangles.resize({static_cast<int64_t>(kept_triangles.size()) / 3, 3});
  std::ranges::copy(kept_triangles, result.triangles.data());
  return result;
}

}  // namespace traceflow::mesh

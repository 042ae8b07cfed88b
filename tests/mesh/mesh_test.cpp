#include "mesh/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace traceflow::mesh {
namespace {

using testing::ElementsAre;

// Strips of 3, 1 and 2 triangles, with a vertex of none between them. Vertex i is at x = i.
TriangleMesh three_strips() {
  TriangleMesh mesh;
  for (Tensor<float>* tensor : {&mesh.vertices, &mesh.normals, &mesh.colours}) {
    tensor->reset({13, 3});
    for (int64_t i = 0; i < 13; ++i) (*tensor)(i, 0) = static_cast<float>(i);
  }
  // The strips' triangles alternate, and one joins two that were apart.
  const std::vector<int32_t> corners = {0, 1, 2, 9, 10, 11, 3, 4, 2, 6, 7, 8, 3, 1, 2, 10, 11, 12};
  mesh.triangles.reset({6, 3});
  std::ranges::copy(corners, mesh.triangles.data());
  return mesh;
}

std::vector<int> places(const TriangleMesh& mesh) {
  std::vector<int> x;
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_EQ(mesh.normals(i, 0), mesh.vertices(i, 0));
    EXPECT_EQ(mesh.colours(i, 0), mesh.vertices(i, 0));
    x.push_back(static_cast<int>(mesh.vertices(i, 0)));
  }
  return x;
}

std::vector<int> corner_places(const TriangleMesh& mesh) {
  std::vector<int> x;
  for (const int32_t vertex : mesh.triangles.values())
    x.push_back(static_cast<int>(mesh.vertices(vertex, 0)));
  return x;
}

TEST(Components, SmallOnesAndLooseVerticesGo) {
  const TriangleMesh mesh = three_strips();
  EXPECT_THAT(places(without_small_components(mesh, 0, 0)),
              ElementsAre(0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12));
  const TriangleMesh two = without_small_components(mesh, 0, 2);
  EXPECT_THAT(places(two), ElementsAre(0, 1, 2, 3, 4, 9, 10, 11, 12));
  EXPECT_THAT(corner_places(two), ElementsAre(0, 1, 2, 9, 10, 11, 3, 4, 2, 3, 1, 2, 10, 11, 12));
  EXPECT_THAT(places(without_small_components(mesh, 2, 0)), ElementsAre(0, 1, 2, 3, 4, 9, 10, 11, 12));
  EXPECT_THAT(places(without_small_components(mesh, 1, 0)), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_THAT(places(without_small_components(mesh, 100, 3)), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(without_small_components(mesh, 0, 4).triangle_count(), 0);
  EXPECT_EQ(without_small_components(TriangleMesh(), 50, 50).triangle_count(), 0);
}

}  // namespace
}  // namespace traceflow::mesh

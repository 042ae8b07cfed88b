#include "mesh/marching_cubes.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "base/random.h"
#include "mesh/shapes.h"

namespace traceflow::mesh {
namespace {

// Distances in the blocks whose places are from `first` to 0 along each axis, all observed.
template <class F>
BlockGrid filled(F&& distance, int first = -1) {
  BlockGrid grid;
  std::vector<uint64_t> keys;
  for (int z = first; z < 1; ++z) {
    for (int y = first; y < 1; ++y) {
      for (int x = first; x < 1; ++x) keys.push_back(BlockGrid::key_of({x, y, z}));
    }
  }
  grid.add(keys);
  for (int64_t b = 0; b < grid.count(); ++b) {
    Block& block = grid[b];
    for (int i = 0; i < block_voxels; ++i) {
      const Vec3<int> at = block.place * block_side + Vec3<int>(i % 8, i / 8 % 8, i / 64);
      block.distance[static_cast<size_t>(i)] = distance(at);
      block.weight[static_cast<size_t>(i)] = 1;
    }
  }
  return grid;
}

using HalfEdges = std::map<std::pair<int32_t, int32_t>, int>;
HalfEdges half_edges(const TriangleMesh& mesh) {
  HalfEdges uses;
  for (int64_t t = 0; t < mesh.triangle_count(); ++t) {
    for (int64_t k = 0; k < 3; ++k) ++uses[{mesh.triangles(t, k), mesh.triangles(t, (k + 1) % 3)}];
  }
  return uses;
}

// Whatever the signs, in every combination of a cell's corners: only the border of the grid cuts the surface.
RC_GTEST_PROP(MarchingCubes, SurfaceHasNoCracks, ()) {
  Random random(*rc::gen::arbitrary<uint64_t>());
  const auto noise = [&](const Vec3<int>&) { return static_cast<float>(random.uniform(-0.49, 0.49)); };
  const TriangleMesh mesh = zero_surface(filled(noise, 0), 1);
  RC_ASSERT(mesh.triangle_count() > 300);
  const HalfEdges uses = half_edges(mesh);
  const auto on_border = [&](int32_t vertex) {
    const V v = vertex_of(mesh, vertex);
    return std::min({v.x, v.y, v.z}) == 0 || std::max({v.x, v.y, v.z}) == 7;
  };
  for (const auto& [edge, count] : uses) {
    RC_ASSERT(count == 1);
    if (!uses.contains({edge.second, edge.first})) RC_ASSERT(on_border(edge.first) && on_border(edge.second));
  }
}

TEST(MarchingCubes, PlaneIsExact) {
  const V normal = normalize(V(1, 2, -2));
  const TriangleMesh mesh = zero_surface(
      filled([&](const Vec3<int>& p) { return static_cast<float>((dot(normal, V(p)) - 0.3) / 4); }), 0.5F);
  ASSERT_GT(mesh.triangle_count(), 100);
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_NEAR(dot(normal, vertex_of(mesh, i)), 0.15, 1e-4);
    EXPECT_NEAR(dot(normal, load3<double>(mesh.normals.row(i))), 1, 1e-5);
  }
  for (int64_t t = 0; t < mesh.triangle_count(); ++t) {
    const V a = vertex_of(mesh, mesh.triangles(t, 0));
    const V across =
        cross(vertex_of(mesh, mesh.triangles(t, 1)) - a, vertex_of(mesh, mesh.triangles(t, 2)) - a);
    EXPECT_GT(dot(across, normal), 0) << "counter-clockwise from outside";
  }
}

TEST(MarchingCubes, NoTriangleHasAnUnobservedCorner) {
  const auto flat = [](const Vec3<int>& p) { return (static_cast<float>(p.z) - 0.5F) / 4; };
  BlockGrid grid = filled(flat);
  EXPECT_EQ(zero_surface(grid, 1).triangle_count(), 2 * 15 * 15);
  Block& block = grid[grid.find({0, 0, 0})];
  block.weight[static_cast<size_t>(Block::index(3, 3, 1))] = 0;
  EXPECT_EQ(zero_surface(grid, 1).triangle_count(), 2 * (15 * 15 - 4));
  block.weight[static_cast<size_t>(Block::index(0, 0, 0))] = 0;
  EXPECT_EQ(zero_surface(grid, 1).triangle_count(), 2 * (15 * 15 - 8)) << "also of neighbouring blocks";
}

// The corner is on none of the edges that the surface crosses.
TEST(MarchingCubes, NoTriangleHasAnUnobservedOppositeCorner) {
  BlockGrid grid = filled([](const Vec3<int>& p) { return p == Vec3<int>(3) ? -0.2F : 0.2F; });
  EXPECT_EQ(zero_surface(grid, 1).triangle_count(), 8);
  Block& block = grid[grid.find({0, 0, 0})];
  block.weight[static_cast<size_t>(Block::index(4, 4, 4))] = 0;
  EXPECT_EQ(zero_surface(grid, 1).triangle_count(), 7);
  block.weight[static_cast<size_t>(Block::index(2, 4, 4))] = 0;
  EXPECT_EQ(zero_surface(grid, 1).triangle_count(), 6);
}

TEST(MarchingCubes, AStepOfATruncationIsNoSurface) {
  const auto step = [](float height) {
    return zero_surface(filled([&](const Vec3<int>& p) { return p.x < 0 ? -height / 2 : height / 2; }), 1)
        .triangle_count();
  };
  EXPECT_GT(step(0.99F), 100);
  EXPECT_EQ(step(1.01F), 0);
}

TEST(MarchingCubes, NothingHasNoSurface) {
  const TriangleMesh mesh = zero_surface(BlockGrid(), 1);
  EXPECT_EQ(mesh.vertex_count(), 0);
  EXPECT_EQ(mesh.triangle_count(), 0);
}

}  // namespace
}  // namespace traceflow::mesh

#include "mesh/chamfer.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "mesh/shapes.h"

namespace traceflow::mesh {
namespace {

TriangleMesh rectangle(double width, double height, double z, const V& normal = {0, 0, -1}) {
  TriangleMesh mesh;
  mesh.vertices = tensor_of(std::vector<float>(12, static_cast<float>(z)));
  mesh.vertices.resize({4, 3});
  mesh.normals.reset({4, 3});
  mesh.colours.reset({4, 3});
  for (int64_t i = 0; i < 4; ++i) {
    mesh.vertices(i, 0) = i == 1 || i == 2 ? static_cast<float>(width) : 0;
    mesh.vertices(i, 1) = i >= 2 ? static_cast<float>(height) : 0;
    store3(mesh.normals.row(i), normal);
  }
  mesh.triangles = tensor_of(std::vector<int32_t>{0, 1, 2, 0, 2, 3});
  mesh.triangles.resize({2, 3});
  return mesh;
}

TEST(SurfaceSamples, SpreadEvenlyByArea) {
  const SurfaceSamples samples = sample_surface(box_mesh(V(0), {1, 2, 3}), 22000);
  std::array<int, 3> across{};
  V middle(0);
  for (int64_t i = 0; i < samples.count(); ++i) {
    const V normal = load3<double>(samples.normals.row(i));
    for (int axis = 0; axis < 3; ++axis) across[static_cast<size_t>(axis)] += std::fabs(normal[axis]) > 0.99;
    middle += load3<double>(samples.points.row(i)) / 22000.0;
  }
  // 6, 3 and 2 of every 11 parts of the area; each part of the area has its samples.
  EXPECT_NEAR(across[0], 12000, 8);
  EXPECT_NEAR(across[1], 6000, 8);
  EXPECT_NEAR(across[2], 4000, 8);
  EXPECT_NEAR(length(middle - V(0.5, 1, 1.5)), 0, 0.03);
}

TEST(SurfaceSamples, AreUniformInATriangle) {
  TriangleMesh mesh = rectangle(2, 1, 0);
  mesh.triangles = tensor_of(std::vector<int32_t>{0, 1, 2});
  mesh.triangles.resize({1, 3});
  const SurfaceSamples samples = sample_surface(mesh, 30000, 3);
  int inner = 0;
  for (int64_t i = 0; i < samples.count(); ++i) {
    // The triangle of the sides' middles has a quarter of the area.
    const double x = samples.points(i, 0) / 2, y = samples.points(i, 1);
    inner += x > 0.5 && y < 0.5 && y > x - 0.5 ? 1 : 0;
    EXPECT_LE(y, x + 1e-6);
  }
  EXPECT_NEAR(inner, 7500, 5 * 75);
}

// Parallel surfaces: the distance is exact, however far apart the samples are.
RC_GTEST_PROP(Chamfer, IsTheDistanceOfParallelSurfaces, ()) {
  const double gap = 1e-3 * *rc::gen::inRange(1, 200);
  const SurfaceError error =
      compare_surfaces(sample_surface(rectangle(2, 1, 0), 500), sample_surface(rectangle(2, 1, gap), 300, 1));
  RC_ASSERT(std::fabs(error.accuracy - gap) < 1e-6);
  RC_ASSERT(std::fabs(error.completeness - gap) < 1e-6);
  RC_ASSERT(std::fabs(error.chamfer() - gap) < 1e-6);
  RC_ASSERT(error.normal_error_deg < 1e-3);
}

// Of a rectangle half is found: what is found is accurate, and what is missing is up to 1 away.
TEST(Chamfer, TellsAccuracyFromCompleteness) {
  const SurfaceSamples half = sample_surface(rectangle(1, 1, 0), 4000),
                       whole = sample_surface(rectangle(2, 1, 0), 4000, 1);
  const SurfaceError error = compare_surfaces(half, whole);
  EXPECT_NEAR(error.accuracy, 0, 1e-6);
  EXPECT_NEAR(error.completeness, 0.25, 0.01);
  const SurfaceError swapped = compare_surfaces(whole, half);
  EXPECT_NEAR(swapped.accuracy, 0.25, 0.01);
  EXPECT_NEAR(swapped.completeness, 0, 1e-6);
}

TEST(Chamfer, NormalErrorIsTheAngle) {
  const double turn = 0.3;
  const auto against = [&](const V& normal) {
    return compare_surfaces(sample_surface(rectangle(2, 1, 0, normal), 500),
                            sample_surface(rectangle(2, 1, 0.1), 500, 1))
        .normal_error_deg;
  };
  EXPECT_NEAR(against({std::sin(turn), 0, -std::cos(turn)}), turn * 180 / std::numbers::pi, 1e-3);
  EXPECT_NEAR(against({0, 0, 1}), 180, 1e-3) << "inside out";
}

// Points without triangles: the distance is that of the nearest point.
TEST(Chamfer, TakesPointsAsTheyAre) {
  SurfaceSamples truth = sample_surface(rectangle(2, 1, 0), 4);
  truth.corners = Tensor<float>();
  for (int64_t i = 0; i < 4; ++i)
    store3(truth.points.row(i), V(i % 2 == 0 ? 0.5 : 1.5, i / 2 == 0 ? 0.25 : 0.75, 0.3));
  const SurfaceError error = compare_surfaces(sample_surface(rectangle(2, 1, 0), 4000), truth);
  EXPECT_NEAR(error.completeness, 0.3, 1e-6);
  EXPECT_GT(error.accuracy, 0.4);
}

}  // namespace
}  // namespace traceflow::mesh

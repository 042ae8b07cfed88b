#include "mesh/fusion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "base/parallel.h"
#include "mesh/shapes.h"
#include "support/refusal.h"

namespace traceflow::mesh {
namespace {

using testing::HasSubstr;

constexpr float voxel = 0.0625F;

double degrees(double radians) { return radians * 180 / std::numbers::pi; }
double angle_between(const V& a, const V& b) { return degrees(std::atan2(length(cross(a, b)), dot(a, b))); }

template <class T>
bool equal(const Tensor<T>& a, const Tensor<T>& b) {
  return a.shape() == b.shape() && std::ranges::equal(a.values(), b.values());
}

TEST(Fusion, SphereIsWithinAFractionOfAVoxel) {
  const V centre(0.1, -0.2, 0.3);
  const TriangleMesh mesh = fused_around(sphere(centre, 1), centre, 4, 24, voxels_of(voxel));
  ASSERT_GT(mesh.triangle_count(), 1000);
  double sum = 0, worst = 0, turn = 0, colour = 0;
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    const V out = vertex_of(mesh, i) - centre;
    const double error = std::fabs(length(out) - 1) / voxel;
    sum += error;
    worst = std::max(worst, error);
    turn += angle_between(load3<double>(mesh.normals.row(i)), out);
    colour += length(load3<double>(mesh.colours.row(i)) - (0.5 + 0.5 * normalize(out)));
    EXPECT_NEAR(length(load3<double>(mesh.normals.row(i))), 1, 1e-5);
  }
  const auto count = static_cast<double>(mesh.vertex_count());
  RecordProperty("mean_error_voxels", std::to_string(sum / count));
  RecordProperty("worst_error_voxels", std::to_string(worst));
  RecordProperty("mean_normal_error_degrees", std::to_string(turn / count));
  EXPECT_LT(sum / count, 0.05);
  EXPECT_LT(worst, 0.3);
  EXPECT_LT(turn / count, 1);
  EXPECT_LT(colour / count, 0.02);

  SurfaceSamples truth{Tensor<float>(Shape{2000, 3}), Tensor<float>(Shape{2000, 3}), Tensor<float>()};
  const std::vector<V> all = directions(2000);
  for (size_t i = 0; i < all.size(); ++i) {
    store3(truth.points.row(static_cast<int64_t>(i)), centre + all[i]);
    store3(truth.normals.row(static_cast<int64_t>(i)), all[i]);
  }
  const SurfaceError error = compare_surfaces(sample_surface(mesh, 20000), truth);
  RecordProperty("completeness_voxels", std::to_string(error.completeness / voxel));
  EXPECT_LT(error.completeness, 0.1 * voxel) << "no part of the sphere is missing";
}

// Every edge has two triangles, one in each direction, and triangles face outwards.
TEST(Fusion, SphereIsClosedAndFacesOutwards) {
  const TriangleMesh mesh = fused_around(sphere(V(0), 1), V(0), 4, 24, voxels_of(voxel));
  std::map<std::pair<int32_t, int32_t>, int> uses;
  for (int64_t t = 0; t < mesh.triangle_count(); ++t) {
    for (int64_t k = 0; k < 3; ++k) ++uses[{mesh.triangles(t, k), mesh.triangles(t, (k + 1) % 3)}];
    const V a = vertex_of(mesh, mesh.triangles(t, 0)), b = vertex_of(mesh, mesh.triangles(t, 1)),
            c = vertex_of(mesh, mesh.triangles(t, 2));
    EXPECT_GT(dot(cross(b - a, c - a), a + b + c), 0);
  }
  for (const auto& [edge, count] : uses) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(uses.contains({edge.second, edge.first}));
  }
  // Euler's formula for a surface without holes: V − E + F = 2, with 3 half-edges to a face.
  EXPECT_EQ(mesh.vertex_count() - static_cast<int64_t>(uses.size()) / 2 + mesh.triangle_count(), 2);
}

TEST(Fusion, BoxIsWithinHalfAVoxel) {
  const V low(-0.83, -0.55, -0.71), high(0.77, 0.49, 0.68);
  const TriangleMesh mesh = fused_around(box(low, high), V(0), 4, 30, voxels_of(voxel));
  const SurfaceError error =
      compare_surfaces(sample_surface(mesh, 20000), sample_surface(box_mesh(low, high), 20000, 1));
  RecordProperty("accuracy_voxels", std::to_string(error.accuracy / voxel));
  RecordProperty("completeness_voxels", std::to_string(error.completeness / voxel));
  RecordProperty("normal_error_degrees", std::to_string(error.normal_error_deg));
  EXPECT_LT(error.accuracy, 0.15 * voxel);
  EXPECT_LT(error.completeness, 0.15 * voxel);
  EXPECT_LT(error.normal_error_deg, 8) << "a third of the surface is within two voxels of an edge";
}

// A sphere seen from one side is a cap: what the camera cannot see is absent.
TEST(Fusion, UnseenSideIsAbsent) {
  Fusion fusion(voxels_of(voxel));
  fusion.integrate(view_of(sphere(V(0), 1), camera_at({0, 0, -4}, V(0))));
  const TriangleMesh mesh = fusion.extract();
  ASSERT_GT(mesh.triangle_count(), 500);
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    EXPECT_LT(vertex_of(mesh, i).z, -0.2) << "tangents touch the sphere at z = −1/4";
    EXPECT_NEAR(length(vertex_of(mesh, i)), 1, 0.3 * voxel);
  }
}

// The space before the wall is observed and so is that behind the front of the sphere: what joins them at the
// sphere's outline is no surface.
TEST(Fusion, NothingJoinsASphereAndTheWallBehind) {
  for (const double distance : {1.2, 1.5, 3.0}) {
    Fusion fusion(voxels_of(voxel));
    const Shape3 shape = first_of({sphere(V(0), 1), wall(distance)});
    for (const double x : {-0.4, -0.2, 0.0, 0.2, 0.4})
      fusion.integrate(view_of(shape, camera_at({x, 0.1 - x / 2, -4}, V(0), 128)));
    const TriangleMesh mesh = fusion.extract();
    ASSERT_GT(mesh.triangle_count(), 500);
    for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
      const V v = vertex_of(mesh, i);
      EXPECT_LT(std::min(std::fabs(length(v) - 1), std::fabs(v.z - distance)), 0.6 * voxel)
          << v.x << " " << v.y << " " << v.z;
      const V colour = std::fabs(length(v) - 1) < 0.1 ? 0.5 + 0.5 * normalize(v) : V(0.5);
      EXPECT_LT(length(load3<double>(mesh.colours.row(i)) - colour), 0.1) << "not that of what is behind";
    }
  }
}

// Two views see a wall at different depths, one from the front and one at an angle: the fused wall is at
// their mean, weighted by the cosine.
TEST(Fusion, ViewsWeighByTheCosineOfTheirAngle) {
  Fusion fusion(voxels_of(voxel));
  const double gap = 0.8 * voxel, angle = 1.0;
  for (const bool slanted : {false, true}) {
    const V from = V(0, 0, 2) + 60.0 * (slanted ? V(std::sin(angle), 0, -std::cos(angle)) : V(0, 0, -1));
    // A long lens, so that the angle is the same all over the image.
    Camera<float> camera = camera_at(from, {0, 0, 2}, 64);
    camera.focal_x = camera.focal_y = 3000;
    fusion.integrate(view_of(wall(slanted ? 2 + gap : 2), camera));
  }
  const TriangleMesh mesh = fusion.extract();
  double sum = 0;
  int64_t count = 0;
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    const V v = vertex_of(mesh, i);
    if (std::fabs(v.x) > 0.4 || std::fabs(v.y) > 0.4) continue;
    sum += v.z;
    ++count;
  }
  ASSERT_GT(count, 100);
  EXPECT_NEAR(sum / static_cast<double>(count), 2 + gap * std::cos(angle) / (1 + std::cos(angle)),
              0.02 * gap);
}

// As in renders: on the outline a pixel's depth is the mean of both surfaces.
TEST(Fusion, BlendedDepthOnAnOutlineIsNoSurface) {
  DepthView view =
      view_of(first_of({box({-0.5, -0.5, 0}, {0.5, 0.5, 0.2}), wall(2)}), camera_at({0, 0, -3}, V(0)));
  const Tensor<float> depth = view.depth;
  for (int64_t y = 0; y < depth.dim(0); ++y) {
    for (int64_t x = 1; x < depth.dim(1); ++x) {
      if (depth(y, x) != depth(y, x - 1)) view.depth(y, x) = (depth(y, x) + depth(y, x - 1)) / 2;
    }
  }
  FusionOptions options = voxels_of(voxel);
  options.components = options.min_triangles = 0;
  Fusion fusion(options);
  fusion.integrate(view);
  const TriangleMesh mesh = fusion.extract();
  ASSERT_GT(mesh.triangle_count(), 500);
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    const double z = vertex_of(mesh, i).z;
    EXPECT_LT(std::min(std::fabs(z), std::fabs(z - 2)), 0.1 * voxel);
  }
}

// One view shows a plate that hangs before the sphere; the others look through the place where it is.
TEST(Fusion, OtherViewsClearWhatTheyLookThrough) {
  FusionOptions options = voxels_of(voxel);
  options.components = options.min_triangles = 0;
  Fusion fusion(options);
  const Shape3 plate = box({-0.3, -0.3, -1.8}, {0.3, 0.3, -1.7});
  fusion.integrate(view_of(first_of({plate, sphere(V(0), 1)}), camera_at({0, 0, -4}, V(0))));
  const auto of_plate = [&] {
    const TriangleMesh mesh = fusion.extract();
    int64_t count = 0;
    for (int64_t i = 0; i < mesh.vertex_count(); ++i) count += vertex_of(mesh, i).z < -1.4 ? 1 : 0;
    return count;
  };
  EXPECT_GT(of_plate(), 50);
  for (const double x : {-0.3, -0.2, -0.1, 0.1, 0.2, 0.3})
    fusion.integrate(view_of(sphere(V(0), 1), camera_at({x, x / 2, -4}, V(0))));
  EXPECT_EQ(of_plate(), 0);
}

// Five views see a wall, and one looks through it: that one counts once, however far it looks, and what it
// sees behind does not colour the wall.
TEST(Fusion, AViewThatLooksThroughCountsOnce) {
  Fusion fusion(voxels_of(voxel));
  for (int i = 0; i < 6; ++i) {
    DepthView view = view_of(wall(i < 5 ? 2 : 4), camera_at({0, 0, -4}, {0, 0, 2}, 64));
    view.colour.fill(i < 5 ? 0.9F : 0.1F);
    fusion.integrate(view);
  }
  const TriangleMesh mesh = fusion.extract();
  ASSERT_GT(mesh.triangle_count(), 100);
  // Five times the distance behind the wall, and one truncation before it, add up to nothing.
  const double place = 2 + 4 * voxel / 5.0;
  int64_t before = 0;
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    if (mesh.vertices(i, 2) > 3 || mesh.normals(i, 2) > 0) continue;
    EXPECT_NEAR(mesh.vertices(i, 2), place, 0.05 * voxel);
    EXPECT_NEAR(mesh.colours(i, 0), 0.9F, 1e-4);
    ++before;
  }
  EXPECT_GT(before, 100);
}

TEST(Fusion, FaintFarAndGrazingPixelsDoNotCount) {
  DepthView view = view_of(wall(2), camera_at(V(0), {0, 0, 1}));
  const auto surface_of = [&](const FusionOptions& options, const DepthView& seen) {
    Fusion fusion(options);
    fusion.integrate(seen);
    return fusion.extract().triangle_count();
  };
  FusionOptions options = voxels_of(voxel);
  EXPECT_GT(surface_of(options, view), 100);
  options.max_depth = 1.9F;
  EXPECT_EQ(surface_of(options, view), 0);
  options.max_depth = 2.1F;
  EXPECT_GT(surface_of(options, view), 100);
  view.alpha.fill(0.49F);
  EXPECT_EQ(surface_of(options, view), 0);
  options.min_alpha = 0.48F;
  EXPECT_GT(surface_of(options, view), 100);
  for (int64_t i = 0; i < view.depth.size(); ++i) {
    const int64_t width = view.camera.width;
    const V ray = normalize(V(view.camera.ray_in_world(static_cast<float>(i % width) + 0.5F,
                                                       static_cast<float>(i / width) + 0.5F)));
    store3(view.normal.data() + 3 * i, viz::perpendicular(ray) - 0.05 * ray);
  }
  EXPECT_EQ(surface_of(options, view), 0) << "seen at 87°";
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 0.0F, -1.0F}) {
    DepthView spoilt = view_of(wall(2), camera_at(V(0), {0, 0, 1}));
    spoilt.depth.fill(bad);
    EXPECT_EQ(surface_of(options, spoilt), 0) << bad;
  }
  view = view_of(wall(2), camera_at(V(0), {0, 0, 1}));
  view.normal.fill(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(surface_of(options, view), 0);
}

RC_GTEST_PROP(Fusion, MovesWithTheScene, ()) {
  const V step(*rc::gen::inRange(-30, 30), *rc::gen::inRange(-30, 30), *rc::gen::inRange(-30, 30));
  const double size = 0.25;
  FusionOptions coarse = voxels_of(static_cast<float>(size));
  coarse.truncation = 2;
  const V centre(0.013 * *rc::gen::inRange(-9, 9), 0.021, -0.017);
  const auto mesh_at = [&](const V& shift) {
    Fusion fusion(coarse);
    for (const V& from : {V(0, 0.5, -3), V(1, -0.4, -3)})
      fusion.integrate(view_of(sphere(centre + shift, 1), camera_at(from + shift, shift, 24)));
    return fusion.extract();
  };
  const TriangleMesh here = mesh_at(V(0)), there = mesh_at(size * step);
  RC_ASSERT(here.triangle_count() > 50);
  // Single precision decides differently about a few voxels at the rim.
  const SurfaceSamples a = sample_surface(here, 2000);
  TriangleMesh back = there;
  for (int64_t i = 0; i < back.vertex_count(); ++i)
    store3(back.vertices.row(i), vertex_of(back, i) - size * step);
  const SurfaceError error = compare_surfaces(a, sample_surface(back, 2000, 1));
  RC_ASSERT(error.accuracy < 2e-3 * size);
  RC_ASSERT(error.completeness < 2e-3 * size);
}

RC_GTEST_PROP(Fusion, TheSameViewTwiceChangesNothing, ()) {
  const V from(0.1 * *rc::gen::inRange(-20, 20), 0.1 * *rc::gen::inRange(-20, 20), -3);
  const DepthView view = view_of(first_of({sphere(V(0), 1), wall(1.3)}), camera_at(from, V(0), 24));
  Fusion once(voxels_of(0.2F)), twice(voxels_of(0.2F));
  once.integrate(view);
  twice.integrate(view);
  twice.integrate(view);
  const TriangleMesh a = once.extract(), b = twice.extract();
  RC_ASSERT(a.triangle_count() > 50);
  RC_ASSERT(equal(a.triangles, b.triangles));
  for (int64_t i = 0; i < a.vertices.size(); ++i) RC_ASSERT(std::fabs(a.vertices[i] - b.vertices[i]) < 1e-5F);
}

TEST(Fusion, SameBytesAtAnyNumberOfThreads) {
  const auto mesh_at = [](int threads) {
    set_threads(threads);
    const TriangleMesh mesh = fused_around(sphere({0.3, 0, 0}, 1), V(0), 4, 6, voxels_of(voxel));
    set_threads(0);
    return mesh;
  };
  const TriangleMesh one = mesh_at(1);
  ASSERT_GT(one.triangle_count(), 1000);
  for (const int threads : {2, 3}) {
    const TriangleMesh several = mesh_at(threads);
    EXPECT_TRUE(equal(one.vertices, several.vertices));
    EXPECT_TRUE(equal(one.normals, several.normals));
    EXPECT_TRUE(equal(one.colours, several.colours));
    EXPECT_TRUE(equal(one.triangles, several.triangles));
  }
}

TEST(Fusion, RefusesOptionsOutOfRange) {
  const auto refusal = [](auto&& change) {
    FusionOptions options = voxels_of(voxel);
    change(options);
    return refusal_of([&] { Fusion fusion(options); });
  };
  EXPECT_EQ(refusal([](FusionOptions&) {}), "accepted");
  EXPECT_THAT(refusal([](FusionOptions& o) { o.voxel = -1; }), HasSubstr("mesh.voxel"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.voxel = std::numeric_limits<float>::quiet_NaN(); }),
              HasSubstr("mesh.voxel"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.resolution = 7; }), HasSubstr("mesh.resolution"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.truncation = 1; }), HasSubstr("mesh.truncation"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.max_depth = -1; }), HasSubstr("mesh.max_depth"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.min_alpha = 0; }), HasSubstr("mesh.min_alpha"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.components = -1; }), HasSubstr("mesh.components"));
  EXPECT_THAT(refusal([](FusionOptions& o) { o.min_triangles = -1; }), HasSubstr("mesh.min_triangles"));
}

// A voxel that is far too small: places that cannot be counted, or more blocks than fit.
TEST(Fusion, RefusesAGridThatIsTooLarge) {
  const auto refusal = [](float size) {
    return refusal_of([&] {
      Fusion fusion(voxels_of(size));
      fusion.integrate(view_of(wall(2), camera_at(V(0), {0, 0, 1}, 400)));
    });
  };
  EXPECT_THAT(refusal(1e-8F), HasSubstr("mesh.max_depth"));
  EXPECT_THAT(refusal(1e-4F), HasSubstr("mesh.max_depth"));
}

}  // namespace
}  // namespace traceflow::mesh

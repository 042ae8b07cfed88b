#include <limits>

#include "surface_scene.h"

namespace traceflow::surface {
namespace {

using namespace traceflow::testing;

Tensor<double> normals_of(const SurfaceScene& s) {
  Tensor<double> normal;
  pseudo_normals(s.camera, s.depth, s.median_depth, s.alpha, s.depth_ratio, normal);
  return normal;
}

template <class T>
struct Gradients {
  Tensor<T> depth, median_depth;
  CameraGradient<T> camera;
};

template <class T>
Gradients<T> gradients_of(const SurfaceScene& s, const Tensor<double>& grad_normal) {
  Gradients<T> g{Tensor<T>(s.depth.shape()), Tensor<T>(s.depth.shape()), {}};
  pseudo_normals_backward(convert<T>(s.camera), convert<T>(s.depth), convert<T>(s.median_depth),
                          convert<T>(s.alpha), static_cast<T>(s.depth_ratio), convert<T>(grad_normal),
                          g.depth, g.median_depth, &g.camera);
  return g;
}

// Oracle: a plane given in world coordinates, whose normal is known.
TEST(PseudoNormals, OfAPlaneAreThePlanesNormal) {
  SurfaceScene s(17, 13);
  const Vec3<double> forward = Vec3<double>(0, 0, 1) * s.camera.camera_from_world;
  const Vec3<double> n = normalize(-forward + Vec3<double>(0.2, 0.3, -0.1));
  const Vec3<double> on_plane = s.camera.position + 2.0 * forward;
  for (int row = 0; row < 13; ++row) {
    for (int column = 0; column < 17; ++column) {
      const Vec3<double> ray = s.camera.ray_in_world(column + 0.5, row + 0.5);
      s.depth(row, column) = s.median_depth(row, column) = dot(n, on_plane - s.camera.position) / dot(n, ray);
    }
  }
  s.alpha.fill(1);
  const Tensor<double> normal = normals_of(s);
  for (int row = 0; row < 13; ++row) {
    for (int column = 0; column < 17; ++column) {
      const bool border = row == 0 || column == 0 || row == 12 || column == 16;
      const Vec3<double> found = load3<double>(&normal(row, column, 0));
      EXPECT_LT(length(found - (border ? Vec3<double>(0) : n)), 1e-9) << row << ' ' << column;
    }
  }
}

TEST(PseudoNormals, TakeTheExpectedDepthWhereThereIsNoMedian) {
  const auto [with, without] = with_and_without_medians(SurfaceScene(9, 8));
  expect_close(normals_of(without), normals_of(with), 1e-12, "normals");
  Random random(4);
  const Tensor<double> a = random_tensor<double>(with.normal.shape(), random, -1, 1);
  const auto found = gradients_of<double>(without, a), expected = gradients_of<double>(with, a);
  expect_gradients_without_medians(without, found.depth, found.median_depth, expected.depth,
                                   expected.median_depth);
}

TEST(PseudoNormals, VanishAroundAHole) {
  const SurfaceScene s(9, 9);
  const Tensor<double> normal = normals_of(s);
  for (int row = 1; row < 8; ++row) {
    for (int column = 1; column < 8; ++column) {
      const bool touches_hole = std::abs(row - 4) + std::abs(column - 4) <= 1;
      EXPECT_EQ(length(load3<double>(&normal(row, column, 0))) < 0.5, touches_hole) << row << ' ' << column;
    }
  }
}

TEST(PseudoNormals, FloatAgreesWithDouble) {
  const SurfaceScene s(40, 50);
  Tensor<float> normal;
  pseudo_normals(convert<float>(s.camera), convert<float>(s.depth), convert<float>(s.median_depth),
                 convert<float>(s.alpha), static_cast<float>(s.depth_ratio), normal);
  expect_close(normal, normals_of(s), 1e-5, "normal");

  Random random(3);
  const Tensor<double> weight = random_tensor<double>({50, 40, 3}, random, -1, 1);
  const auto fast = gradients_of<float>(s, weight);
  const auto plain = gradients_of<double>(s, weight);
  expect_close(fast.depth, plain.depth, 1e-4, "depth");
  expect_close(fast.median_depth, plain.median_depth, 1e-4, "median depth");
  expect_close(camera_tensors(fast.camera)[0], camera_tensors(plain.camera)[0], 1e-4, "rotation");
}

TEST(PseudoNormals, GradientAgreesWithCentralDifferences) {
  SurfaceScene s(7, 20);  // more rows than a band, so that gathering crosses its edge
  Random random(5);
  const Tensor<double> weight = random_tensor<double>({20, 7, 3}, random, -1, 1);
  const auto value = [&] { return testing::dot(weight, normals_of(s)); };
  const auto gradient = gradients_of<double>(s, weight);
  expect_close(gradient.depth, central_differences(s.depth, value), 1e-6, "depth");
  expect_close(gradient.median_depth, central_differences(s.median_depth, value), 1e-6, "median depth");
  const auto camera = camera_differences(s.camera, value);
  expect_close(camera_tensors(gradient.camera)[0], camera[0], 1e-6, "rotation");
  // Moving the eye moves all points alike: exact up to rounding of the sum.
  EXPECT_LT(length(gradient.camera.position), 1e-9);
}

TEST(PseudoNormals, AddToTheGradients) {
  const SurfaceScene s(9, 9);
  Tensor<double> weight({9, 9, 3});
  weight.fill(0.5);
  const auto once = gradients_of<double>(s, weight);
  auto twice = once;
  pseudo_normals_backward(s.camera, s.depth, s.median_depth, s.alpha, s.depth_ratio, weight, twice.depth,
                          twice.median_depth, &twice.camera);
  for (int64_t i = 0; i < 81; ++i) EXPECT_DOUBLE_EQ(twice.depth[i], 2 * once.depth[i]);
}

TEST(PseudoNormals, HostileValuesStayWhereTheyAre) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Random random(7);
  const Tensor<double> weight = random_tensor<double>({9, 9, 3}, random, -1, 1);
  SurfaceScene clean(9, 9);
  clean.alpha.fill(1);
  for (const double bad : {nan, infinity, -infinity, 1e300, 0.0}) {
    SurfaceScene s = clean;
    s.depth(2, 3) = bad;
    s.median_depth(2, 3) = bad;
    const Tensor<double> normal = normals_of(s), expected = normals_of(clean);
    EXPECT_TRUE(all_finite(normal));
    const auto g = gradients_of<double>(s, weight);
    EXPECT_TRUE(all_finite(g.depth) && all_finite(g.median_depth) && all_finite(camera_tensors(g.camera)[0]));
    for (int row = 0; row < 9; ++row) {
      for (int column = 0; column < 9; ++column) {
        if (std::abs(row - 2) + std::abs(column - 3) <= 1) continue;
        EXPECT_EQ(load3<double>(&normal(row, column, 0)), load3<double>(&expected(row, column, 0)));
      }
    }
  }
  Tensor<double> bad_weight = weight;
  bad_weight(4, 4, 1) = nan;
  const auto g = gradients_of<double>(clean, bad_weight);
  EXPECT_TRUE(all_finite(g.depth) && all_finite(camera_tensors(g.camera)[0]));
}

TEST(PseudoNormals, SmallImagesHaveNone) {
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 2}, {1, 9}, {9, 2}}) {
    const SurfaceScene s(width, height);
    const Tensor<double> normal = normals_of(s);
    for (const double v : normal.values()) EXPECT_EQ(v, 0);
    const auto g = gradients_of<double>(s, Tensor<double>({height, width, 3}));
    for (const double v : g.depth.values()) EXPECT_EQ(v, 0);
  }
}

TEST(PseudoNormals, RefuseShapesThatDoNotFit) {
  SurfaceScene s(9, 9);
  s.depth.reset({9, 8});
  EXPECT_THROW(normals_of(s), InternalError);
}

TEST(PseudoNormals, SameBytesAtAnyThreadCount) {
  const SurfaceScene s(33, 100);
  Random random(9);
  const Tensor<double> weight = random_tensor<double>({100, 33, 3}, random, -1, 1);
  expect_same_bytes_at_any_thread_count([&] {
    const auto g = gradients_of<float>(s, weight);
    return std::vector{camera_tensors(g.camera)[0], g.depth, g.median_depth, convert<float>(normals_of(s))};
  });
}

}  // namespace
}  // namespace traceflow::surface

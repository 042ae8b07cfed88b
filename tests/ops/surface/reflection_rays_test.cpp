#include <limits>
#include <numeric>

#include "surface_scene.h"

namespace traceflow::surface {
namespace {

using namespace traceflow::testing;

struct Rays {
  Tensor<double> origins, directions;
};

Rays rays_of(const SurfaceScene& s, const std::vector<int32_t>& pixels) {
  Rays rays;
  reflection_rays(s.camera, tensor_of(pixels), s.depth, s.median_depth, s.normal, s.depth_ratio, rays.origins,
                  rays.directions);
  return rays;
}

template <class T>
struct RayGradients {
  Tensor<T> depth, median_depth, normal;
  CameraGradient<T> camera;

  std::vector<Tensor<T>> tensors() const {
    std::vector<Tensor<T>> all = camera_tensors(camera);
    all.insert(all.end(), {depth, median_depth, normal});
    return all;
  }
};

template <class T>
RayGradients<T> ray_gradients_of(const SurfaceScene& s, const std::vector<int32_t>& pixels,
                                 const Tensor<double>& grad_origins, const Tensor<double>& grad_directions) {
  RayGradients<T> g{Tensor<T>(s.depth.shape()), Tensor<T>(s.depth.shape()), Tensor<T>(s.normal.shape()), {}};
  reflection_rays_backward(convert<T>(s.camera), tensor_of(pixels), convert<T>(s.depth),
                           convert<T>(s.median_depth), convert<T>(s.normal), static_cast<T>(s.depth_ratio),
                           convert<T>(grad_origins), convert<T>(grad_directions), g.depth, g.median_depth,
                           g.normal, &g.camera);
  return g;
}

// Every third pixel.
std::vector<int32_t> some_pixels(const SurfaceScene& s) {
  std::vector<int32_t> pixels;
  for (int32_t i = 1; i < s.depth.size(); i += 3) pixels.push_back(i);
  return pixels;
}

// Oracle: the law of reflection. The mirrored direction has unit length, lies in the plane of ray and normal,
// and its part along the normal is the ray's, turned round.
TEST(ReflectionRays, ObeyTheLawOfReflection) {
  const SurfaceScene s(11, 7);
  const auto pixels = some_pixels(s);
  const Rays rays = rays_of(s, pixels);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const int row = pixels[i] / 11, column = pixels[i] % 11;
    const auto k = static_cast<int64_t>(i);
    const Vec3<double> ray = s.camera.ray_in_world(column + 0.5, row + 0.5);
    const Vec3<double> in = normalize(ray), out = load3<double>(rays.directions.row(k));
    const Vec3<double> n = normalize(load3<double>(&s.normal(row, column, 0)));
    EXPECT_NEAR(length(out), 1, 1e-12);
    EXPECT_NEAR(dot(out, n), -dot(in, n), 1e-12);
    EXPECT_NEAR(dot(out, cross(in, n)), 0, 1e-12);
    EXPECT_NEAR(dot(out - dot(out, n) * n, in - dot(in, n) * n), 1 - dot(in, n) * dot(in, n), 1e-12);
    const double z = 0.7 * s.depth(row, column) + 0.3 * s.median_depth(row, column);
    EXPECT_LT(length(load3<double>(rays.origins.row(k)) - (s.camera.position + z * ray)), 1e-12);
    EXPECT_NEAR(s.camera.point_in_camera(load3<double>(rays.origins.row(k))).z, z, 1e-12);
  }
}

TEST(ReflectionRays, FloatAgreesWithDouble) {
  const SurfaceScene s(60, 50);
  const auto pixels = some_pixels(s);
  const Rays plain = rays_of(s, pixels);
  Tensor<float> origins, directions;
  reflection_rays(convert<float>(s.camera), tensor_of(pixels), convert<float>(s.depth),
                  convert<float>(s.median_depth), convert<float>(s.normal), static_cast<float>(s.depth_ratio),
                  origins, directions);
  expect_close(origins, plain.origins, 1e-5, "origins");
  expect_close(directions, plain.directions, 1e-5, "directions");

  Random random(3);
  const Tensor<double> a = random_tensor<double>(origins.shape(), random, -1, 1);
  const Tensor<double> b = random_tensor<double>(origins.shape(), random, -1, 1);
  const auto fast = ray_gradients_of<float>(s, pixels, a, b).tensors();
  const auto truth = ray_gradients_of<double>(s, pixels, a, b).tensors();
  for (size_t i = 0; i < fast.size(); ++i) expect_close(fast[i], truth[i], 1e-4, "gradient");
}

TEST(ReflectionRays, StartAtTheExpectedDepthWhereThereIsNoMedian) {
  const auto [with, without] = with_and_without_medians(SurfaceScene(9, 8));
  const auto pixels = some_pixels(with);
  expect_close(rays_of(without, pixels).origins, rays_of(with, pixels).origins, 1e-12, "origins");
  Random random(4);
  const Shape shape{static_cast<int64_t>(pixels.size()), 3};
  const Tensor<double> a = random_tensor<double>(shape, random, -1, 1);
  const Tensor<double> b = random_tensor<double>(shape, random, -1, 1);
  const auto found = ray_gradients_of<double>(without, pixels, a, b),
             expected = ray_gradients_of<double>(with, pixels, a, b);
  expect_gradients_without_medians(without, found.depth, found.median_depth, expected.depth,
                                   expected.median_depth);
}

TEST(ReflectionRays, GradientAgreesWithCentralDifferences) {
  SurfaceScene s(7, 6);
  const auto pixels = some_pixels(s);
  Random random(5);
  const Shape shape{static_cast<int64_t>(pixels.size()), 3};
  const Tensor<double> a = random_tensor<double>(shape, random, -1, 1);
  const Tensor<double> b = random_tensor<double>(shape, random, -1, 1);
  const auto value = [&] {
    const Rays rays = rays_of(s, pixels);
    return testing::dot(a, rays.origins) + testing::dot(b, rays.directions);
  };
  const auto gradient = ray_gradients_of<double>(s, pixels, a, b);
  expect_close(gradient.depth, central_differences(s.depth, value), 1e-7, "depth");
  expect_close(gradient.median_depth, central_differences(s.median_depth, value), 1e-7, "median depth");
  expect_close(gradient.normal, central_differences(s.normal, value, 1e-6), 1e-7, "normal");
  const auto camera = camera_differences(s.camera, value);
  expect_close(camera_tensors(gradient.camera)[0], camera[0], 1e-7, "rotation");
  expect_close(camera_tensors(gradient.camera)[1], camera[1], 1e-7, "position");
}

TEST(ReflectionRays, HostilePixelsGiveNoDirectionAndNoGradient) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::vector<int32_t> pixels(42);
  std::iota(pixels.begin(), pixels.end(), 0);
  Tensor<double> ones({42, 3});
  ones.fill(1);
  const auto clean = ray_gradients_of<double>(SurfaceScene(7, 6), pixels, ones, ones).tensors();
  for (const double bad : {nan, infinity, -infinity}) {
    SurfaceScene s(7, 6);
    s.depth[5] = bad;
    s.normal(1, 3, 2) = bad;
    for (int c = 0; c < 3; ++c) s.normal(2, 1, c) = 0;
    const Rays rays = rays_of(s, pixels);
    EXPECT_TRUE(all_finite(rays.origins) && all_finite(rays.directions));
    for (const int64_t i : {5, 10, 15}) EXPECT_EQ(load3<double>(rays.directions.row(i)), Vec3<double>(0));
    const auto g = ray_gradients_of<double>(s, pixels, ones, ones);
    for (const auto& tensor : g.tensors()) EXPECT_TRUE(all_finite(tensor));
    EXPECT_EQ(g.depth[5], 0);
    EXPECT_EQ(g.depth[6], clean[2][6]);
  }
  Tensor<double> bad_gradient = ones;
  bad_gradient[20] = nan;
  for (const auto& tensor :
       ray_gradients_of<double>(SurfaceScene(7, 6), pixels, bad_gradient, ones).tensors()) {
    EXPECT_TRUE(all_finite(tensor));
  }
}

TEST(ReflectionRays, NoPixelsNoRays) {
  const SurfaceScene s(7, 6);
  const Rays rays = rays_of(s, {});
  EXPECT_EQ(rays.origins.shape(), Shape({0, 3}));
  EXPECT_EQ(rays.directions.shape(), Shape({0, 3}));
  const auto g = ray_gradients_of<double>(s, {}, rays.origins, rays.directions);
  for (const double v : g.depth.values()) EXPECT_EQ(v, 0);
}

TEST(ReflectionRays, RefusePixelsOutsideTheImageOrOutOfOrder) {
  const SurfaceScene s(7, 6);
  for (const auto& pixels : std::vector<std::vector<int32_t>>{{-1}, {42}, {3, 3}, {4, 3}}) {
    EXPECT_THROW(rays_of(s, pixels), InternalError);
  }
}

TEST(ReflectionRays, SameBytesAtAnyThreadCount) {
  const SurfaceScene s(120, 90);
  std::vector<int32_t> pixels(120 * 90);
  std::iota(pixels.begin(), pixels.end(), 0);
  Random random(11);
  const Tensor<double> a = random_tensor<double>({10800, 3}, random, -1, 1);
  expect_same_bytes_at_any_thread_count([&] { return ray_gradients_of<float>(s, pixels, a, a).tensors(); });
}

}  // namespace
}  // namespace traceflow::surface

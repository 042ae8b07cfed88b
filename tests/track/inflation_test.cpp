#include "track/inflation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace traceflow {
namespace {

constexpr float focal = 400;

Camera<float> camera_of(int64_t height, int64_t width) {
  Camera<float> camera;
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  camera.focal_x = camera.focal_y = focal;
  camera.centre_x = static_cast<float>(width) / 2;
  camera.centre_y = static_cast<float>(height) / 2;
  return camera;
}

std::vector<int64_t> disc(const Camera<float>& camera, const Vec2<float>& centre, float radius) {
  std::vector<int64_t> pixels;
  for (int64_t i = 0; i < static_cast<int64_t>(camera.width) * camera.height; ++i) {
    const int64_t row = i / camera.width, column = i % camera.width;
    const Vec2<float> at(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F);
    if (length(at - centre) < radius) pixels.push_back(i);
  }
  return pixels;
}

TEST(Inflation, MakesHalfABallOfADisc) {
  const Camera<float> camera = camera_of(90, 120);
  constexpr float radius = 30, depth = 5;
  const Tensor<float> points = inflated(disc(camera, {60, 45}, radius), camera, depth, 100000);
  ASSERT_GT(points.dim(0), 2500);
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vec3<float> p = load3<float>(points.row(i));
    // A pixel of the outline lies up to one and a half pixels inside the circle.
    const Vec2<float> across = Vec2<float>(p.x, p.y) * (focal / p.z);
    const float round = std::sqrt(std::max(0.0F, radius * radius - dot(across, across)));
    EXPECT_NEAR((depth - p.z) * focal / depth, round, round > radius / 2 ? 2.5F : 10.0F);
    EXPECT_LE(p.z, depth);
  }
}

// A ball before a wall, whose depths are a tenth too small, and between the ball's and the wall's at the
// outline.
TEST(AtDepths, PointsLieOnTheSurfaceUpToTheOutline) {
  const Camera<float> camera = camera_of(90, 120);
  const std::vector<int64_t> part = disc(camera, {60, 45}, 30);
  Tensor<uint8_t> mask({90, 120});
  for (const int64_t pixel : part) mask[pixel] = 1;
  constexpr float wall = 6, wrong = 0.9F;
  const auto surface = [](const Vec2<float>& at) {
    const Vec2<float> off = (at - Vec2<float>(60, 45)) / 30.0F;
    return 5 - 0.3F * std::sqrt(std::max(0.0F, 1 - dot(off, off)));
  };
  Tensor<float> depth({90, 120});
  for (int64_t i = 0; i < depth.size(); ++i) {
    const Vec2<float> at(static_cast<float>(i % 120) + 0.5F, static_cast<float>(i / 120) + 0.5F);
    const float off = length(at - Vec2<float>(60, 45));
    depth[i] = wrong * (mask[i] == 0 ? wall : off > 28.6F ? 0.5F * (wall + surface(at)) : surface(at));
  }
  Tensor<float> points({400, 3});
  for (int64_t i = 0; i < 400; ++i) {
    const Vec2<float> at(6.0F * static_cast<float>(i % 20) + 1, 4.5F * static_cast<float>(i / 20) + 1);
    store3(points.row(i), camera.position + wall * camera.ray_in_world(at.x, at.y));
  }
  const Tensor<float> made = at_depths(part, mask, camera, depth, points, 100000);
  EXPECT_EQ(made.dim(0), static_cast<int64_t>(part.size()));
  for (int64_t i = 0; i < made.dim(0); ++i) {
    const Vec3<float> p = load3<float>(made.row(i));
    EXPECT_NEAR(p.z, surface(camera.project(camera.point_in_camera(p))), 0.12F);
  }
  const int64_t few = at_depths(part, mask, camera, depth, points, 400).dim(0);
  EXPECT_GT(few, 200);
  EXPECT_LE(few, 400);
  EXPECT_EQ(at_depths(part, mask, camera, {}, points, 400).dim(0), 0);
  EXPECT_EQ(at_depths(part, mask, camera, depth, Tensor<float>({0, 3}), 400).dim(0), 0) << "no scale";
}

TEST(Inflation, ThePicturesBorderIsNoOutline) {
  const Camera<float> camera = camera_of(90, 120);
  // Half of a disc, cut off by the left border: it is highest there.
  const Tensor<float> points = inflated(disc(camera, {0, 45}, 30), camera, 5, 100000);
  float nearest = 5;
  for (int64_t i = 0; i < points.dim(0); ++i) nearest = std::min(nearest, points(i, 2));
  EXPECT_NEAR((5 - nearest) * focal / 5, 30, 2);
}

TEST(Inflation, KeepsToTheLimitAndStaysEven) {
  const Camera<float> camera = camera_of(90, 120);
  const std::vector<int64_t> part = disc(camera, {60, 45}, 30);
  const Tensor<float> points = inflated(part, camera, 5, 400);
  EXPECT_LE(points.dim(0), 400);
  EXPECT_GT(points.dim(0), 200);
  float mean = 0;
  for (int64_t i = 0; i < points.dim(0); ++i) mean += points(i, 0) / points(i, 2);
  EXPECT_NEAR(mean / static_cast<float>(points.dim(0)) * focal, 0, 1);
}

TEST(Inflation, IsAsFarAsTheNearestOfWhatStandsBeside) {
  const Camera<float> camera = camera_of(90, 120);
  const std::vector<int64_t> part = disc(camera, {60, 45}, 20), other = disc(camera, {95, 45}, 12);
  Tensor<uint8_t> mask({90, 120});
  for (const int64_t pixel : part) mask[pixel] = 1;
  for (const int64_t pixel : other) mask[pixel] = 1;
  std::vector<float> points;
  const auto add = [&](float x, float y, float z) {
    const Vec3<float> p = z * camera.ray_in_camera(x, y);
    points.insert(points.end(), {p.x, p.y, p.z});
  };
  for (int k = 0; k < 20; ++k) add(50 + static_cast<float>(k), 69, 3 + 0.1F * static_cast<float>(k));
  // Behind the thing, far beside it, and on another thing.
  for (int k = 0; k < 40; ++k) add(50 + 0.5F * static_cast<float>(k), 45, 9);
  for (int k = 0; k < 40; ++k) add(5, 10 + static_cast<float>(k), 1);
  for (int k = 0; k < 40; ++k) add(84, 40 + 0.2F * static_cast<float>(k), 1);
  const auto tensor = [](const std::vector<float>& values) {
    Tensor<float> result({static_cast<int64_t>(values.size()) / 3, 3});
    std::copy(values.begin(), values.end(), result.data());
    return result;
  };
  const std::optional<float> depth = depth_beside(part, mask, camera, tensor(points));
  ASSERT_TRUE(depth);
  EXPECT_GE(*depth, 3.1F);
  EXPECT_LT(*depth, 3.3F);
  EXPECT_FALSE(depth_beside(part, mask, camera, tensor({points.begin() + 60, points.end()})));
}

}  // namespace
}  // namespace traceflow

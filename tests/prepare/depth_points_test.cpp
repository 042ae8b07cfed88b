#include "prepare/depth_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>

#include "base/parallel.h"

namespace traceflow::prepare {
namespace {

constexpr int wall_width = 40, wall_height = 30, wall_views = 6;
constexpr double wall = 4;

// Cameras side by side that look at a slanted wall, z = 4 + x / 2, from another `step` each.
std::vector<DepthView> views_of_wall(double step = 0.2) {
  std::vector<DepthView> views;
  for (int i = 0; i < wall_views; ++i) {
    DepthView view;
    view.camera.width = wall_width;
    view.camera.height = wall_height;
    view.camera.focal_x = view.camera.focal_y = 40;
    view.camera.centre_x = 20;
    view.camera.centre_y = 15;
    view.camera.position = {step * i, 0, 0};
    view.depth.reset({wall_height, wall_width});
    for (int64_t y = 0; y < wall_height; ++y) {
      for (int64_t x = 0; x < wall_width; ++x) {
        const Vec3<double> ray =
            view.camera.ray_in_camera(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
        // z = 4 + (p + ray·z) / 2
        view.depth(y, x) = static_cast<float>((wall + view.camera.position.x / 2) / (1 - ray.x / 2));
      }
    }
    views.push_back(view);
  }
  return views;
}

AgreeingPoints found_in(const std::vector<DepthView>& views, int64_t most = 1000) {
  const std::atomic<bool> stop = false;
  return agreeing_points(views, 1, most, stop);
}

TEST(DepthPoints, LieOnTheSurface) {
  const std::vector<DepthView> views = views_of_wall();
  const AgreeingPoints found = found_in(views);
  EXPECT_GT(found.points.size(), 500U);
  EXPECT_GE(found.sampled, static_cast<int64_t>(found.points.size()));
  for (const DepthPoint& point : found.points) {
    EXPECT_NEAR(point.position.z, wall + point.position.x / 2, 1e-5);
    EXPECT_LT(point.error, 1e-4);
    ASSERT_GE(point.seen.size(), 3U);
    for (const DepthPoint::Sighting& sighting : point.seen) {
      const Camera<double>& camera = views[static_cast<size_t>(sighting.view)].camera;
      EXPECT_LT(length(camera.project(camera.point_in_camera(point.position)) - sighting.at), 1e-3);
    }
  }
}

TEST(DepthPoints, AreAtMostSoManyOfAllViews) {
  const AgreeingPoints found = found_in(views_of_wall(), 200);
  ASSERT_EQ(found.points.size(), 200U);
  EXPECT_GT(found.agreeing, 200);
  std::vector<int> of_view(wall_views);
  for (const DepthPoint& point : found.points) ++of_view[static_cast<size_t>(point.seen.front().view)];
  for (const int n : of_view) EXPECT_GT(n, 10);
}

// In frame i something stands before the wall at columns that no other frame shows there.
TEST(DepthPoints, AreNotOnWhatMoves) {
  std::vector<DepthView> views = views_of_wall();
  for (int64_t i = 0; i < wall_views; ++i) {
    for (int64_t y = 5; y < 25; ++y) {
      for (int64_t x = 6 * i; x < 6 * i + 6; ++x) views[static_cast<size_t>(i)].depth(y, x) = 2;
    }
  }
  const AgreeingPoints found = found_in(views);
  EXPECT_GT(found.points.size(), 300U);
  for (const DepthPoint& point : found.points) EXPECT_GT(point.position.z, 2.5);
}

// Frames 1 to 3 show a thing before the wall. Of those that are compared with each of them, two show it too,
// and two see the wall through it.
TEST(DepthPoints, AreNotWhereAsManyFramesSeeThrough) {
  std::vector<DepthView> views = views_of_wall();
  for (const size_t i : {1U, 2U, 3U}) views[i].depth.fill(2);
  for (const DepthPoint& point : found_in(views).points) {
    const bool all_see = std::ranges::all_of(
        views, [&](const DepthView& view) { return view.camera.sees(point.position, 0, -1); });
    EXPECT_FALSE(all_see && point.position.z < 2.5) << point.seen.front().view;
  }
  // Two frames more of six are enough.
  for (const size_t i : {0U, 4U}) views[i].depth.fill(2);
  EXPECT_TRUE(std::ranges::any_of(found_in(views).points,
                                  [](const DepthPoint& point) { return point.position.z < 2.5; }));
}

TEST(DepthPoints, NeedParallax) {
  EXPECT_TRUE(found_in(views_of_wall(0.005)).points.empty());
  EXPECT_FALSE(found_in(views_of_wall(0.05)).points.empty());
}

TEST(DepthPoints, NeedThreeViewsThatAgree) {
  std::vector<DepthView> views = views_of_wall();
  for (size_t i = 2; i < views.size(); ++i) {
    for (float& z : views[i].depth.values()) z *= 1.1F;
  }
  views.resize(3);
  EXPECT_TRUE(found_in(views).points.empty());
  views.resize(2);
  EXPECT_TRUE(found_in(views).points.empty());
}

TEST(DepthPoints, UnknownDepthsAreIgnored) {
  std::vector<DepthView> views = views_of_wall();
  for (DepthView& view : views) {
    const std::array<float, 4> unknown{0, -3, std::numeric_limits<float>::quiet_NaN(),
                                       std::numeric_limits<float>::infinity()};
    for (int64_t y = 0; y < wall_height; ++y) {
      for (int64_t x = 0; x < wall_width / 2; ++x) view.depth(y, x) = unknown[static_cast<size_t>(x + y) % 4];
    }
  }
  const AgreeingPoints found = found_in(views);
  EXPECT_GT(found.points.size(), 100U);
  for (const DepthPoint& point : found.points) {
    EXPECT_NEAR(point.position.z, wall + point.position.x / 2, 1e-5);
    for (const DepthPoint::Sighting& sighting : point.seen) EXPECT_GE(sighting.at.x, 20.5);
  }
}

TEST(DepthPoints, AreTheSameAtAnyNumberOfThreads) {
  const std::vector<DepthView> views = views_of_wall();
  set_threads(1);
  const AgreeingPoints one = found_in(views, 300);
  set_threads(3);
  const AgreeingPoints three = found_in(views, 300);
  set_threads(0);
  ASSERT_EQ(one.points.size(), three.points.size());
  for (size_t i = 0; i < one.points.size(); ++i) EXPECT_EQ(one.points[i].position, three.points[i].position);
}

}  // namespace
}  // namespace traceflow::prepare

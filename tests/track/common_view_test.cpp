#include "track/common_view.h"

#include <gtest/gtest.h>

#include <cmath>

namespace traceflow {
namespace {

View looking(const Vec3<float>& position, const Vec3<float>& target) {
  View view;
  view.camera.width = 80;
  view.camera.height = 60;
  view.camera.focal_x = view.camera.focal_y = 100;
  view.camera.centre_x = 40;
  view.camera.centre_y = 30;
  const Vec3<float> z = glm::normalize(target - position);
  const Vec3<float> x = glm::normalize(cross(Vec3<float>(0, 0, -1), z));
  view.camera.camera_from_world = transpose(Mat3<float>(x, cross(z, x), z));
  view.camera.position = position;
  return view;
}

int seen_by(const std::vector<View>& views, const Vec3<float>& point) {
  int count = 0;
  for (const View& view : views) {
    const Vec3<float> x = view.camera.point_in_camera(point);
    if (x.z <= 0) continue;
    const Vec2<float> at = view.camera.project(x);
    count += at.x >= 0 && at.x < 80 && at.y >= 0 && at.y < 60 ? 1 : 0;
  }
  return count;
}

// Cameras around an object: points lie about it, not about the cameras.
TEST(CommonView, a_ring_of_cameras_gives_points_in_its_middle) {
  std::vector<View> views;
  for (int i = 0; i < 24; ++i) {
    const float a = 6.2831853F * static_cast<float>(i) / 24;
    views.push_back(looking({4 * std::cos(a) + 1, 4 * std::sin(a), 1.5F}, {1, 0, 0}));
  }
  Random random(1);
  const Tensor<float> points = points_in_common_view(views, 4.4F, 2000, random);
  ASSERT_EQ(points.dim(0), 2000);
  Vec3<float> mean(0);
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const auto x = load3<float>(points.row(i));
    EXPECT_LT(length(x - Vec3<float>(1, 0, 0)), 3);
    EXPECT_GE(seen_by(views, x), 12);
    mean += x / 2000.0F;
  }
  EXPECT_LT(length(mean - Vec3<float>(1, 0, 0)), 0.5F);
}

TEST(CommonView, cameras_side_by_side_give_points_before_them) {
  std::vector<View> views;
  views.reserve(10);
  for (int i = 0; i < 10; ++i)
    views.push_back(looking({0.1F * static_cast<float>(i), 0, 0}, {0.1F * static_cast<float>(i), 5, 0}));
  Random random(2), again(2);
  const Tensor<float> points = points_in_common_view(views, 0.5F, 500, random);
  ASSERT_EQ(points.dim(0), 500);
  float nearest = 100, farthest = 0;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    nearest = std::min(nearest, points(i, 1));
    farthest = std::max(farthest, points(i, 1));
  }
  EXPECT_GE(nearest, 0.09F);
  EXPECT_GT(farthest, 3);
  EXPECT_LE(farthest, 5.01F);
  const Tensor<float> same = points_in_common_view(views, 0.5F, 500, again);
  EXPECT_TRUE(std::equal(points.data(), points.data() + points.size(), same.data()));
}

TEST(CommonView, no_views_give_no_points) {
  Random random(3);
  EXPECT_EQ(points_in_common_view({}, 1, 100, random).dim(0), 0);
}

}  // namespace
}  // namespace traceflow

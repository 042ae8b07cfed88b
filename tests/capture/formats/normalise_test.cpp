#include "capture/formats/normalise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace traceflow {
namespace {

// A camera at `position` that looks at `target`.
FoundView looking(const Vec3<double>& position, const Vec3<double>& target) {
  FoundView view;
  const Vec3<double> z = glm::normalize(target - position);
  const Vec3<double> x =
      glm::normalize(cross(std::abs(z.y) < 0.9 ? Vec3<double>(0, 1, 0) : Vec3<double>(1, 0, 0), z));
  view.camera_from_world = transpose(Mat3<double>(x, cross(z, x), z));
  view.position = position;
  return view;
}

std::vector<FoundView> hemisphere(Random& random, const Vec3<double>& centre, double radius) {
  std::vector<FoundView> views;
  for (int i = 0; i < 60; ++i) {
    const Vec3<double> d(random.normal(), random.normal(), std::abs(random.normal()));
    views.push_back(looking(centre + radius * glm::normalize(d), centre));
  }
  return views;
}

TEST(Normalise, without_points_the_origin_is_where_all_cameras_look) {
  Random random(4);
  const Vec3<double> centre(30, -20, 5);
  const auto views = hemisphere(random, centre, 4);
  const SceneNormalisation found = normalise(views, {});
  EXPECT_LT(length(found.centre - centre), 1e-9);
  for (const FoundView& view : views) {
    const double distance = length(found.in_scene(view.position));
    EXPECT_TRUE(distance > 0.2 && distance < 0.6) << distance;
  }
}

TEST(Normalise, cameras_side_by_side_or_back_to_back_have_no_common_sight) {
  std::vector<FoundView> side_by_side, outward;
  for (int i = 0; i <= 10; ++i) {
    side_by_side.push_back(looking({i, 0, 0}, {i, 0, 10}));
    // On half a ring: its axes meet behind the cameras, in the origin.
    const Vec3<double> d(std::cos(0.314 * i), std::sin(0.314 * i), 0.1 * (i % 2));
    outward.push_back(looking(d, 2.0 * d));
  }
  EXPECT_LT(length(normalise(side_by_side, {}).centre - Vec3<double>(5, 0, 0)), 1e-9);
  EXPECT_NEAR(normalise(side_by_side, {}).scale, 1.0 / 10, 1e-9);
  EXPECT_LT(length(normalise(outward, {}).centre - Vec3<double>(0, 0.5, 0.05)), 0.01);
}

TEST(Normalise, points_and_cameras_share_a_box_that_outliers_do_not_move) {
  Random random(5);
  std::vector<FoundView> views = hemisphere(random, {0, 0, 0}, 1);
  std::vector<Vec3<double>> points;
  points.reserve(2021);
  for (int i = 0; i < 2000; ++i) {
    points.emplace_back(random.uniform(-4, 0), random.uniform(-2, 2), random.uniform(-1, 1));
  }
  const SceneNormalisation clean = normalise(views, points);
  for (int i = 0; i < 20; ++i) points.emplace_back(1e6 * random.normal(), 1e6, -1e6);
  points.emplace_back(std::nan(""));
  const SceneNormalisation found = normalise(views, points);
  EXPECT_LT(length(found.centre - clean.centre), 0.15);
  EXPECT_NEAR(found.scale / clean.scale, 1, 0.05);
  // The box is about 5 × 4 × 2.
  EXPECT_NEAR(1 / found.scale, std::sqrt(25 + 16 + 4), 0.6);
}

TEST(Normalise, nothing_to_measure_leaves_the_units) {
  EXPECT_EQ(normalise({}, {}), SceneNormalisation());
  const std::vector<FoundView> one = {looking({3, 4, 5}, {3, 4, 9})};
  EXPECT_EQ(normalise(one, {}).scale, 1);
  EXPECT_EQ(normalise(one, {}).centre, Vec3<double>(3, 4, 5));
}

// A camera that turns on a tripod, as a solver finds it.
TEST(Normalise, rounding_is_no_scene_and_no_scale_is_beyond_what_is_held) {
  for (const double away : {0.0, 1.0, 1e6}) {
    std::vector<FoundView> turning;
    for (int i = 0; i < 10; ++i) {
      const Vec3<double> at(away + 1e-13 * (1 + away) * i, away, 0);
      turning.push_back(looking(at, at + Vec3<double>(0, 0, 1)));
    }
    EXPECT_EQ(normalise(turning, {}).scale, 1) << away;
  }
  const std::vector<FoundView> apart = {looking({-1e15, 0, 0}, {-1e15, 0, 9}),
                                        looking({1e15, 0, 0}, {1e15, 0, 9})};
  EXPECT_EQ(normalise(apart, {}).scale, 1e-12);
  const std::vector<FoundView> small = {looking({0, 0, 0}, {0, 0, 9}), looking({1e-6, 0, 0}, {1e-6, 0, 9})};
  EXPECT_NEAR(normalise(small, {}).scale, 1e6, 1);
}

}  // namespace
}  // namespace traceflow

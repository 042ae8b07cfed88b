#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "capture/checks/checks.h"
#include "capture/extent.h"

// Cameras and points alone: ways of filming that must not be called wrong, and what must.
namespace traceflow {
namespace {

using testing::ElementsAre;

constexpr double turn = 6.283185307179586;

Camera<float> looking(const Vec3<double>& from, const Vec3<double>& at) {
  const Vec3<double> z = normalize(at - from), x = normalize(cross(Vec3<double>(0, 0.01, 1), z)),
                     y = cross(z, x);
  Camera<float> camera;
  camera.width = 80;
  camera.height = 60;
  camera.focal_x = camera.focal_y = 80;
  camera.centre_x = 40;
  camera.centre_y = 30;
  camera.camera_from_world = Mat3<float>(transpose(Mat3<double>(x, y, z)));
  camera.position = Vec3<float>(from);
  return camera;
}

void add(Capture& capture, const Vec3<double>& from, const Vec3<double>& at) {
  const std::string id = std::to_string(capture.train.size());
  capture.train.push_back({id, static_cast<float>(capture.train.size()) / 100, looking(from, at)});
}

Vec3<double> on_circle(double share, double radius) {
  return {radius * std::cos(turn * share), radius * std::sin(turn * share), 0.3};
}

Capture orbit() {
  Capture capture;
  for (int i = 0; i < 40; ++i) add(capture, on_circle(i / 40.0, 3), {0, 0, 0});
  return capture;
}

// A box of points around the middle.
Tensor<float> cloud(int64_t count) {
  Tensor<float> points({count, 3});
  for (int64_t i = 0; i < 3 * count; ++i)
    points[i] = static_cast<float>(0.5 * std::sin(static_cast<double>(i * i % 1009)));
  return points;
}

std::vector<std::string> kinds(const Capture& capture) {
  Findings findings;
  check_positions(capture, findings);
  check_directions(capture, findings);
  check_points(capture, findings);
  std::vector<std::string> result;
  for (const Finding& f : findings) result.push_back(f.kind);
  return result;
}

TEST(Ways, of_filming_are_healthy) {
  Capture capture = orbit();
  capture.points = cloud(500);
  EXPECT_THAT(kinds(capture), ElementsAre()) << "an orbit";

  capture.train.clear();
  for (int i = 0; i < 40; ++i) add(capture, {0.1 * i, 0, 0}, {0.1 * i, 5, 0});
  capture.points = {};
  EXPECT_THAT(kinds(capture), ElementsAre()) << "along a line, axes parallel";

  capture.train.clear();
  for (int i = 0; i < 40; ++i) add(capture, on_circle(i / 40.0, 0.2), on_circle(i / 40.0, 5));
  EXPECT_THAT(kinds(capture), ElementsAre()) << "from the middle outward";

  capture.train.clear();
  for (int i = 0; i < 40; ++i) add(capture, {0.001 * std::sin(i), 0.001 * std::cos(i), 0}, {0, 5, 0});
  for (int i = 1; i < 12; ++i) add(capture, {0.05 * i, 0, 0}, {0, 5, 0});
  EXPECT_THAT(kinds(capture), ElementsAre()) << "long at one place, then away step by step";

  // Too few of them to be a second group: each is within reach of the one before.
  capture = orbit();
  for (int i = 1; i <= 4; ++i) add(capture, {3 + 2.5 * i, 0, 0.3}, {0, 0, 0});
  EXPECT_THAT(kinds(capture), ElementsAre()) << "away from an orbit";
}

TEST(Positions, an_outlier_among_test_cameras_leaves_the_extent) {
  Capture capture = orbit();
  capture.test.push_back({"test", 0, looking({40, 0, 0}, {0, 0, 0})});
  Findings findings;
  check_positions(capture, findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].kind, "camera-apart");
  EXPECT_THAT(findings[0].views, ElementsAre("test"));
  EXPECT_EQ(findings[0].text.find("extent"), std::string::npos);
}

TEST(Positions, a_second_group_is_no_outlier) {
  Capture capture = orbit();
  for (int i = 0; i < 10; ++i) add(capture, Vec3<double>(60, 0, 0) + on_circle(i / 10.0, 3), {0, 0, 0});
  EXPECT_THAT(kinds(capture), ElementsAre());
}

TEST(Directions, two_that_look_away_among_many) {
  Capture capture = orbit();
  capture.train[3].camera = looking(Vec3<double>(capture.train[3].camera.position), {9, 9, 0});
  capture.train[30].camera = looking(Vec3<double>(capture.train[30].camera.position), {-2, -20, 0});
  Findings findings;
  check_directions(capture, findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_THAT(findings[0].views, ElementsAre("3", "30"));
}

TEST(Points, a_view_that_sees_hardly_any) {
  Capture capture = orbit();
  capture.points = cloud(500);
  // Not so far off that it looked away.
  capture.train[5].camera = looking(Vec3<double>(capture.train[5].camera.position), {0, 0, 2.2});
  EXPECT_THAT(kinds(capture), ElementsAre("few-points"));
}

TEST(Points, many_that_nobody_sees) {
  Capture capture = orbit();
  capture.points = cloud(500);
  for (int64_t i = 0; i < 420; ++i) capture.points(i, 2) += 9;
  Findings findings;
  const auto sight = check_points(capture, findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].kind, "points-unseen");
  EXPECT_NEAR(sight.unseen, 0.84, 1e-9);
  EXPECT_EQ(sight.behind, 0);
}

// Parallel cameras in a line and a hundred points: so many behind them all, so many above their pictures, and
// in each picture what is left.
Capture line(int64_t behind, int64_t above) {
  Capture capture;
  for (int i = 0; i < 40; ++i) add(capture, {0.1 * i, 0, 0}, {0.1 * i, 5, 0});
  capture.points = Tensor<float>({100, 3});
  for (int64_t i = 0; i < 100; ++i) {
    capture.points(i, 0) = 2;
    capture.points(i, 1) = i < behind ? -3.0F : 5.0F;
    capture.points(i, 2) = i >= behind && i < behind + above ? 40.0F : 0.0F;
  }
  return capture;
}

TEST(Points, that_nobody_sees_are_told_whether_they_lie_behind_or_not) {
  Findings findings;
  check_points(line(30, 60), findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].kind, "points-unseen");
  EXPECT_THAT(findings[0].text, testing::StartsWith("90% of the points"));
  EXPECT_NEAR(*findings[0].value, 0.9, 1e-9);
  EXPECT_EQ(*findings[0].threshold, 0.8);
  EXPECT_THAT(kinds(line(45, 45)), ElementsAre("points-behind", "points-unseen"));
  EXPECT_THAT(kinds(line(30, 45)), ElementsAre()) << "75%";
}

TEST(Points, that_lie_behind_are_not_told_twice) {
  EXPECT_THAT(kinds(line(90, 5)), ElementsAre("points-behind"));
}

TEST(Extent, is_the_largest_distance_from_the_mean) {
  EXPECT_DOUBLE_EQ(camera_extent({{0, 0, 0}, {2, 0, 0}, {1, 3, 0}}), 1.1 * 2);
  EXPECT_EQ(camera_extent({{4, 5, 6}}), 0);
}

}  // namespace
}  // namespace traceflow

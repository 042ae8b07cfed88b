#include "viz/capture_picture/camera_map.h"

#include <gtest/gtest.h>

#include "viz/capture_picture/inks.h"

namespace traceflow::viz {
namespace {

// A camera at `from` that looks along world y, z being up.
View view(const std::string& id, float time, const Vec3<float>& from) {
  Camera<float> camera;
  camera.width = 40;
  camera.height = 30;
  camera.focal_x = camera.focal_y = 40;
  camera.camera_from_world =
      transpose(Mat3<float>(Vec3<float>(1, 0, 0), Vec3<float>(0, 0, -1), Vec3<float>(0, 1, 0)));
  camera.position = from;
  return {id, time, camera};
}

bool has(const Tensor<uint8_t>& picture, const Ink& ink, int64_t left, int64_t right) {
  for (int64_t y = 40; y < picture.dim(0) - 30; ++y) {
    for (int64_t x = left; x < right; ++x) {
      if (is(picture, y, x, ink)) return true;
    }
  }
  return false;
}

TEST(CameraMap, knows_up_and_ahead_from_the_cameras) {
  Capture capture;
  capture.train = {view("a", 0, {-1, 0, 0}), view("b", 1, {1, 0, 0})};
  const MapViews views = map_views(capture);
  EXPECT_NEAR(distance(views.top.right, Vec3<double>(1, 0, 0)), 0, 1e-6);
  EXPECT_NEAR(distance(views.top.up, Vec3<double>(0, 1, 0)), 0, 1e-6);
  EXPECT_NEAR(distance(views.side.right, Vec3<double>(0, 1, 0)), 0, 1e-6);
  EXPECT_NEAR(distance(views.side.up, Vec3<double>(0, 0, 1)), 0, 1e-6);
}

TEST(CameraMap, shows_cameras_in_their_times_colours_and_marked_ones_ringed_at_the_border) {
  Capture capture;
  capture.train = {view("a", 0, {-1, 0, 0}), view("b", 1, {1, 0, 0}), view("far", 0.5F, {900, 0, 0})};
  capture.test = {view("t", 0.5F, {0, 0, 0})};
  const Marks marks{{"far", "camera-apart"}};
  const Tensor<uint8_t> map = camera_map(capture, marks, map_views(capture).top, "top", {300, 200});
  EXPECT_TRUE(has(map, time_ink(0), 0, 60));
  EXPECT_FALSE(has(map, time_ink(0), 60, 300));
  EXPECT_TRUE(has(map, time_ink(1), 240, 300));
  EXPECT_TRUE(has(map, test_ink, 130, 170)) << "the test camera's square";
  EXPECT_TRUE(has(map, alarm_ink, 270, 300)) << "who is outside stands at the border";
  EXPECT_FALSE(has(map, alarm_ink, 0, 270));
}

TEST(CameraMap, holds_cameras_that_are_marked_for_something_else) {
  Capture capture;
  capture.train = {view("a", 0, {-1, 0, 0}), view("b", 1, {1, 0, 0}), view("c", 0.5F, {3, 0, 0})};
  const Tensor<uint8_t> map = camera_map(capture, {{"c", "blur"}}, map_views(capture).top, "", {300, 200});
  EXPECT_TRUE(has(map, time_ink(0), 0, 60));
  EXPECT_TRUE(has(map, time_ink(1), 130, 170)) << "in the middle between a and c";
  EXPECT_TRUE(has(map, alarm_ink, 260, 300));
  EXPECT_FALSE(has(map, alarm_ink, 0, 260));
}

TEST(CameraMap, shows_points_at_their_places_and_brighter_where_there_are_more) {
  Capture capture;
  capture.train = {view("a", 0, {-1, 0, 0}), view("b", 1, {1, 0, 0})};
  for (View& v : capture.train) {
    v.camera.focal_x = v.camera.focal_y = 1;
    v.camera.centre_x = 20;
    v.camera.centre_y = 15;
  }
  // The last one, which lies behind the cameras, does not shrink the map.
  const std::vector<Vec3<float>> points{
      {0.25F, 0.75F, 0}, {-0.25F, 0.25F, 0.1F}, {-0.25F, 0.25F, -0.1F}, {0.25F, 1, 0}, {0, -40, 0}};
  capture.points = Tensor<float>({5, 3});
  for (int64_t i = 0; i < 5; ++i) store3(capture.points.row(i), points[static_cast<size_t>(i)]);
  const Tensor<uint8_t> map = camera_map(capture, {}, {{1, 0, 0}, {0, 1, 0}}, "", {300, 200});
  // What it holds is 2 wide, on 252 pixels between the margins, and its middle is (0, 0.5).
  const Ink one{110, 110, 110}, two{140, 140, 140};
  EXPECT_TRUE(is(map, 68, 181, one)) << "(0.25, 0.75) is at 150 + 31.5 and 100 - 31.5";
  EXPECT_TRUE(is(map, 131, 118, two)) << "(-0.25, 0.25) is at 150 - 31.5 and 100 + 31.5";
  for (const int64_t step : {-1, 1}) {
    EXPECT_TRUE(is(map, 68 + step, 181, paper));
    EXPECT_TRUE(is(map, 68, 181 + step, paper));
  }
}

TEST(CameraMap, of_one_camera_and_of_none_that_does_not_stand_apart) {
  Capture capture;
  capture.train = {view("a", 0, {5, 5, 5})};
  EXPECT_EQ(camera_map(capture, {}, map_views(capture).top, "", {50, 40}).shape(), (Shape{40, 50, 3}));
  EXPECT_EQ(camera_map(capture, {{"a", "camera-apart"}}, map_views(capture).side, "", {50, 40}).shape(),
            (Shape{40, 50, 3}));
}

}  // namespace
}  // namespace traceflow::viz

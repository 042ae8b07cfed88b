#include "math/camera.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "math/rotation.h"

namespace traceflow {
namespace {

Camera<double> turned_camera(Random& random) {
  Camera<double> camera;
  camera.width = 64;
  camera.height = 48;
  camera.focal_x = 70;
  camera.focal_y = 55;
  camera.centre_x = 30;
  camera.centre_y = 27;
  camera.camera_from_world = rotation_from_quaternion(
      Vec4<double>(random.normal(), random.normal(), random.normal(), random.normal()));
  camera.position = {random.normal(), random.normal(), random.normal()};
  return camera;
}

// Axes as OpenCV has them: right is +x, down is +y, forward is +z.
TEST(Camera, LooksAlongItsOwnAxes) {
  Camera<double> camera;
  camera.focal_x = camera.focal_y = 10;
  camera.centre_x = camera.centre_y = 5;
  EXPECT_EQ(camera.ray_in_camera(5, 5), Vec3<double>(0, 0, 1));
  EXPECT_GT(camera.project({0.1, 0, 1}).x, 5);
  EXPECT_GT(camera.project({0, 0.1, 1}).y, 5);
}

// A camera that stands at (0, 0, −5) and looks along world's x: what lies before it has positive depth.
TEST(Camera, PointInCameraTurnsAfterMoving) {
  Camera<double> camera;
  camera.position = {0, 0, -5};
  camera.camera_from_world =
      transpose(Mat3<double>(Vec3<double>(0, 0, -1), Vec3<double>(0, 1, 0), Vec3<double>(1, 0, 0)));
  const Vec3<double> ahead = camera.point_in_camera({3, 0, -5});
  EXPECT_NEAR(length(ahead - Vec3<double>(0, 0, 3)), 0, 1e-15);
  EXPECT_NEAR(length(camera.point_in_camera({0, 0, -6}) - Vec3<double>(1, 0, 0)), 0, 1e-15);
}

TEST(Camera, RaysComeBackToTheirPixels) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Camera<double> camera = turned_camera(random);
    const double x = random.uniform(0, 64), y = random.uniform(0, 48), z = random.uniform(0.1, 10);
    const Vec3<double> point = camera.point_in_camera(camera.position + z * camera.ray_in_world(x, y));
    EXPECT_NEAR(point.z, z, 1e-12);  // the ray's camera z is 1
    EXPECT_NEAR(camera.project(point).x, x, 1e-10);
    EXPECT_NEAR(camera.project(point).y, y, 1e-10);
  }
}

TEST(Camera, ConvertKeepsEveryField) {
  Random random(2);
  const Camera<double> camera = turned_camera(random);
  const auto there = convert<float>(camera);
  const auto back = convert<double>(there);
  EXPECT_EQ(back.width, 64);
  EXPECT_EQ(back.height, 48);
  EXPECT_EQ(Vec4<double>(back.focal_x, back.focal_y, back.centre_x, back.centre_y),
            Vec4<double>(70, 55, 30, 27));
  EXPECT_LT(length(back.position - camera.position), 1e-6);
  for (int c = 0; c < 3; ++c)
    EXPECT_LT(length(back.camera_from_world[c] - camera.camera_from_world[c]), 1e-6);
}

}  // namespace
}  // namespace traceflow

#include "viz/cameras/spiral.h"

#include <gtest/gtest.h>

#include <cmath>

namespace traceflow::viz {
namespace {

// Looks along z from (x, y, 0).
Camera<float> camera_at(float x, float y) {
  Camera<float> camera;
  camera.width = 64;
  camera.height = 48;
  camera.focal_x = camera.focal_y = 50;
  camera.centre_x = 32;
  camera.centre_y = 24;
  camera.position = {x, y, 0};
  return camera;
}

// Turned about y so that it looks at (0, 0, 10).
Camera<float> looking_inwards(float x) {
  Camera<float> camera = camera_at(x, 0);
  const float s = -x / std::hypot(x, 10.0F), c = 10 / std::hypot(x, 10.0F);
  camera.camera_from_world = Mat3<float>(c, 0, s, 0, 1, 0, -s, 0, c);
  return camera;
}

TEST(Spiral, GoesAsFarAsTheCamerasDidAndLooksAtWhatTheyLookAt) {
  const auto shots = spiral_around_cameras({looking_inwards(-2), looking_inwards(0), looking_inwards(2)}, 80);
  ASSERT_EQ(shots.size(), 80U);
  float left = 0, right = 0, up = 0, down = 0;
  for (const Shot& shot : shots) {
    const Camera<float>& c = shot.camera;
    EXPECT_EQ(c.width, 64);
    const Vec2<float> pixel = c.project(c.point_in_camera({0, 0, 10}));
    EXPECT_NEAR(pixel.x, 32, 1e-2);
    EXPECT_NEAR(pixel.y, 24, 1e-2);
    const Mat3<float> r = c.camera_from_world * transpose(c.camera_from_world);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(r[i][i], 1, 1e-5);
    EXPECT_NEAR(c.position.z, 0, 1e-3);
    left = std::min(left, c.position.x);
    right = std::max(right, c.position.x);
    up = std::min(up, c.position.y);
    down = std::max(down, c.position.y);
  }
  // Of three cameras nine tenths are two: the mean and one of the outer ones.
  EXPECT_NEAR(right, 2, 1e-3);
  EXPECT_NEAR(left, -2, 1e-3);
  // Nobody stood higher or lower: a fiftieth of the way to what is looked at.
  EXPECT_NEAR(down, 0.2, 1e-3);
  EXPECT_NEAR(up, -0.2, 1e-3);
}

TEST(Spiral, ClosesAndMovesEvenAroundOneCamera) {
  const auto shots = spiral_around_cameras({camera_at(1, 1)}, 200);
  float longest = 0, right = 0;
  for (size_t i = 0; i < shots.size(); ++i) {
    const float step = length(shots[i].camera.position - shots[(i + 1) % shots.size()].camera.position);
    EXPECT_GT(step, 0);
    longest = std::max(longest, step);
    right = std::max(right, shots[i].camera.position.x);
  }
  EXPECT_LT(longest, 0.01F);
  EXPECT_GT(right, 1.01F);
}

}  // namespace
}  // namespace traceflow::viz

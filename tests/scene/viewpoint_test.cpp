#include "scene/viewpoint.h"

#include <gtest/gtest.h>

#include "math/rotation.h"

namespace traceflow {
namespace {

const SceneNormalisation scene = {{1, 2, 3}, 0.5};

Viewpoint oblique() { return {{4, -2, 7}, rotation_from_quaternion(Vec4<double>(1, 2, -0.5, 0.3)), 40}; }

TEST(Viewpoint, ACameraIsWhereItWasPut) {
  const Viewpoint placed = oblique();
  const Viewpoint again = viewpoint_of(camera_at(placed, 320, 200, scene), scene);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(again.position[i], placed.position[i], 1e-5);
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(again.world_from_camera[i][j], placed.world_from_camera[i][j], 1e-6);
  }
  EXPECT_NEAR(again.fov_y, 40, 1e-4);
}

TEST(Viewpoint, TheAngleIsFromTopToBottom) {
  const Camera<float> camera = camera_at({{0, 0, 0}, Mat3<double>(1), 90}, 320, 200, {});
  const Vec2<float> top = camera.project(Vec3<float>(0, -1, 1));
  EXPECT_NEAR(top.y, 0, 1e-4);
  EXPECT_NEAR(top.x, 160, 1e-4);
  EXPECT_EQ(camera.focal_x, camera.focal_y);
}

TEST(Viewpoint, ACarriedCameraSeesTheSame) {
  const SceneNormalisation other = {{-1, 0, 5}, 3};
  const Camera<float> camera = camera_at(oblique(), 320, 200, scene);
  const Camera<float> moved = renormalised(camera, scene, other);
  const Vec3<double> point(1, 1, 1);  // of the capture
  const Vec2<float> here = camera.project(camera.point_in_camera(Vec3<float>(scene.in_scene(point))));
  const Vec2<float> there = moved.project(moved.point_in_camera(Vec3<float>(other.in_scene(point))));
  EXPECT_NEAR(here.x, there.x, 1e-2);
  EXPECT_NEAR(here.y, there.y, 1e-2);
  EXPECT_EQ(renormalised(camera, scene, scene).position, camera.position);
}

}  // namespace
}  // namespace traceflow

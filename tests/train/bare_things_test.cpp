#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "train/tumbling.h"

namespace traceflow {
namespace {

// The capture without the points that its first view sees in its mask or beside it, or with these so many
// times as far away.
Capture without_points_of_things(float farther = 0) {
  Capture capture = load_capture(tumbling(), {});
  const View& first = capture.train.front();
  const Tensor<uint8_t> mask = load_images(capture, first)->mask;
  std::vector<float> left;
  for (int64_t i = 0; i < capture.points.dim(0); ++i) {
    Vec3<float> x = load3<float>(capture.points.row(i));
    if (first.camera.sees(x)) {
      const Vec2<float> at = first.camera.project(first.camera.point_in_camera(x));
      bool is_beside = false;
      for (const float y : {at.y - 2, at.y, at.y + 2}) {
        for (const float column : {at.x - 2, at.x, at.x + 2})
          is_beside |= mask(std::clamp<int64_t>(static_cast<int64_t>(y), 0, mask.dim(0) - 1),
                            std::clamp<int64_t>(static_cast<int64_t>(column), 0, mask.dim(1) - 1)) != 0;
      }
      if (is_beside && farther == 0) continue;
      if (is_beside) x = first.camera.position + farther * (x - first.camera.position);
    }
    left.insert(left.end(), {x.x, x.y, x.z});
  }
  capture.points.reset({static_cast<int64_t>(left.size()) / 3, 3});
  std::copy(left.begin(), left.end(), capture.points.data());
  return capture;
}

void expect_inflated_surface(const Capture& bare) {
  Tumbling at;
  const std::optional<MotionTruth> truth = load_motion_truth(at.capture);
  Random random(1);
  at.scene = initial_scene(bare, preset("cpu"), random).scene;
  ASSERT_TRUE(at.scene.main_motion);
  ASSERT_EQ(at.scene.main_motion->bodies(), 2);
  const Vec3<double> eye(bare.train.front().camera.position);
  for (const int32_t body : {0, 1}) {
    const auto points = true_points(at.capture, *truth, thing_of(at, *truth, body), 0);
    Vec3<double> middle(0), carried_middle(0);
    for (const Vec3<double>& p : points) middle += p / static_cast<double>(points.size());
    int64_t carried = 0;
    for (int64_t i = 0; i < at.scene.main.count(); ++i) {
      if (at.scene.main.body[i] != body) continue;
      ++carried;
      carried_middle += load3<double>(at.scene.main.position.row(i));
    }
    ASSERT_GT(carried, 100);
    carried_middle /= static_cast<double>(carried);
    // Where it is seen, and as far away as what it stands on.
    EXPECT_GT(dot(normalize(carried_middle - eye), normalize(middle - eye)), std::cos(0.02));
    EXPECT_NEAR(length(carried_middle - eye) / length(middle - eye), 1, 0.15);
  }
}

TEST(BareThings, GetAnInflatedSurfaceWhereTheyAre) {
  const Capture bare = without_points_of_things();
  ASSERT_LT(bare.points.dim(0), load_capture(tumbling(), {}).points.dim(0) - 500);
  expect_inflated_surface(bare);
}

TEST(BareThings, HaveNoPointsThatLieBehindThem) { expect_inflated_surface(without_points_of_things(1.6F)); }

TEST(BareThings, AreFollowed) { expect_to_be_followed(without_points_of_things()); }

TEST(BareThings, LeaveTheScenesLimitAsItIs) {
  TrainOptions options = preset("cpu");
  options.initial.max_points = 200;
  Random random(1);
  const InitialScene made = initial_scene(without_points_of_things(), options, random);
  EXPECT_EQ(made.scene.main.count(), 200);
  EXPECT_EQ(made.at_points, 100);
}

}  // namespace
}  // namespace traceflow

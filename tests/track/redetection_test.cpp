#include "track/redetection.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "math/rotation_group.h"
#include "track/ball_body.h"
#include "track/mask_parts.h"

namespace traceflow {
namespace {

using ball_body::centre, ball_body::picture_at, ball_body::stretched_ball;

const TrackWeights weights{0.5F, 0.3F, {0.0F}};
const PoseSteps steps{8, 2};

Surfels small_body() { return stretched_ball({0.4, 0.2, 0.12}); }

// A motion of two keys, at both of which the body is where it was put.
Motion standing_at(const Vec3<double>& turn, const Vec3<double>& shift) {
  Tensor<float> pivot({1, 3});
  store3(pivot.row(0), centre);
  Motion motion = still_motion(pivot, tensor_of(std::vector<float>{0, 1}));
  const Vec4<double> q = quaternion_exp(turn);
  for (int64_t key = 0; key < 2; ++key) {
    for (int k = 0; k < 4; ++k) motion.rotation(0, key, k) = static_cast<float>(q[k]);
    store3(&motion.shift(0, key, 0), shift);
  }
  return motion;
}

double turn_off(const Motion& motion, const Vec3<double>& turn) {
  const Vec4<double> found = unit_quaternion(load4<double>(&motion.rotation(0, 1, 0)));
  return glm::length(quaternion_log(quaternion_product(found, quaternion_conjugate(quaternion_exp(turn)))));
}

// From one picture to the next the body has jumped by more than its size, has turned, and has gone away.
TEST(Redetection, FindsABodyThatHasJumped) {
  const Surfels surfels = small_body();
  const Vec3<double> turn(0.1, -0.3, 0.5), shift(0.35, -0.3, 0.4);
  const TrackTarget picture = picture_at(surfels, standing_at(turn, shift), false);
  for (const bool finds : {false, true}) {
    Motion motion = standing_at({}, {-0.2, 0.2, 0});
    PoseSolver solver(surfels, nullptr, motion, 1, {}, {picture});
    solver.solve(weights, steps);
    const int found = finds ? find_lost_bodies(solver, surfels, motion, 1, weights, steps) : 0;
    EXPECT_EQ(found, finds ? 1 : 0);
    const double off = glm::length(load3<double>(&motion.shift(0, 1, 0)) - shift);
    EXPECT_EQ(off < 0.05, finds) << off;
    EXPECT_EQ(turn_off(motion, turn) < 0.1, finds) << turn_off(motion, turn);
    EXPECT_EQ(load3<double>(&motion.shift(0, 0, 0)), Vec3<double>(Vec3<float>(-0.2F, 0.2F, 0)));
  }
}

// A body that has left the picture, or is where it should be, is left alone.
TEST(Redetection, LeavesAloneWhatIsNotLostOrNowhere) {
  const Surfels surfels = small_body();
  TrackTarget empty = picture_at(surfels, standing_at({}, {}), false);
  empty.coverage.fill(0);
  empty.mask.fill(0);
  for (const TrackTarget& picture : {empty, picture_at(surfels, standing_at({}, {0.05, 0, 0}), false)}) {
    Motion motion = standing_at({}, {});
    const Motion before = motion;
    PoseSolver solver(surfels, nullptr, motion, 1, {}, {picture});
    EXPECT_EQ(find_lost_bodies(solver, surfels, motion, 1, weights, steps), 0);
    EXPECT_TRUE(std::ranges::equal(motion.rotation.values(), before.rotation.values()));
    EXPECT_TRUE(std::ranges::equal(motion.shift.values(), before.shift.values()));
  }
}

TEST(MaskParts, TouchByCornersAndKeepEveryPixel) {
  Tensor<uint8_t> mask({3, 5});
  for (const int64_t at : {0, 6, 4, 9, 12}) mask[at] = 1;
  const std::vector<std::vector<int64_t>> parts = mask_parts(mask);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0], (std::vector<int64_t>{0, 6, 12}));
  EXPECT_EQ(parts[1], (std::vector<int64_t>{4, 9}));
}

}  // namespace
}  // namespace traceflow

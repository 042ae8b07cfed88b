#include "track/pose_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "math/rotation_group.h"
#include "track/ball_body.h"

namespace traceflow {
namespace {

using ball_body::ball, ball_body::centre, ball_body::picture_of, ball_body::turned_by;

const Vec3<double> true_turn(0.03, 0.09, -0.02);

TEST(PoseSolver, ColourTakesBackTheTurnOfAMirrorAndNotOfATexture) {
  const Surfels surfels = ball();
  for (const bool mirrors : {false, true}) {
    Motion motion = turned_by(true_turn);
    const Tensor<float> rotation = motion.rotation;
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, true_turn, mirrors)});
    const Vec3<double> turn = solver.turns_by_colour()[0];
    const Vec3<double> expected = mirrors ? -true_turn : Vec3<double>(0);
    EXPECT_LT(length(turn - expected), 0.2 * length(true_turn)) << mirrors;
    EXPECT_TRUE(std::ranges::equal(motion.rotation.values(), rotation.values()));
  }
}

// Neither the outline nor the normals of a ball tell how it has turned.
TEST(PoseSolver, ABallIsSeenToTurnByItsColourAlone) {
  const Surfels surfels = ball();
  for (const float colour : {0.0F, 1.0F}) {
    Motion motion = turned_by(Vec3<double>(0));
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, true_turn, false)});
    solver.solve({0.5F, 0.3F, {colour}}, {8, 2});
    const Vec3<double> found = quaternion_log(unit_quaternion(load4<double>(&motion.rotation(0, 0, 0))));
    const Vec3<double> expected = colour > 0 ? true_turn : Vec3<double>(0);
    EXPECT_LT(length(found - expected), 0.2 * length(true_turn)) << colour;
  }
}

// A ball that is too far away and beside its place comes back to both, or with its depth held to its place
// beside alone.
TEST(PoseSolver, HoldsTheDepthAndNothingElse) {
  const Surfels surfels = ball();
  const Vec3<double> ray = normalize(centre + Vec3<double>(0.06, 0, 0.2));
  for (const bool holds : {false, true}) {
    Motion motion = turned_by(Vec3<double>(0));
    store3(&motion.shift(0, 0, 0), Vec3<double>(0.06, 0, 0.2));
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, Vec3<double>(0), false)});
    solver.solve({0.5F, 0.3F, {0.0F}}, {20, 4, holds});
    const Vec3<double> shift = load3<double>(&motion.shift(0, 0, 0));
    const double along = dot(centre + shift, ray) - dot(centre, ray);
    EXPECT_NEAR(along, holds ? dot(Vec3<double>(0.06, 0, 0.2), ray) : 0.0, holds ? 0.005 : 0.03);
    EXPECT_LT(std::abs(shift.x), 0.02) << holds;
  }
}

// The mask is wider than the ball all around, as where surface comes into view that it does not have yet. The
// normals there do not pull the ball towards the camera.
TEST(PoseSolver, NormalsOfWhatNoBodyCoversDoNotCount) {
  const Surfels surfels = ball();
  TrackTarget picture = picture_of(surfels, Vec3<double>(0), false);
  const Camera<float>& camera = picture.camera;
  for (int64_t at = 0; at < picture.mask.size(); ++at) {
    const Vec2<float> off(static_cast<float>(at % camera.width) + 0.5F - camera.centre_x,
                          static_cast<float>(at / camera.width) + 0.5F - camera.centre_y);
    const float radius = length(off);
    if (picture.coverage[at] > 0.95F || radius > 27) continue;
    picture.mask[at] = 1;
    store3(&picture.normal_prior[3 * at], Vec3<float>(off.x, off.y, 0) / radius);
  }
  Motion motion = turned_by(Vec3<double>(0));
  PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture});
  solver.solve({0, 0.3F, {0.0F}}, {8, 0.5});
  EXPECT_LT(std::abs(motion.shift(0, 0, 2)), 0.02F);
}

}  // namespace
}  // namespace traceflow

#include "track/texture_trust.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "math/rotation.h"
#include "math/similarity_fit.h"
#include "track/ball_body.h"
#include "track/mirror_image.h"

namespace traceflow {
namespace {

using ball_body::ball, ball_body::centre, ball_body::picture_of, ball_body::radius, ball_body::stretched_ball,
    ball_body::turned_by;

// Colour is trusted where it takes back little of the turns that there were, and of none before there were
// any.
TEST(TextureTrust, HoldsColourThatTakesBackLittle) {
  const auto holds = [](double taken_back, double turned) {
    TextureTrust trust = TextureTrust::of(1);
    trust.taken_back_by_colour[0] = taken_back;
    trust.turned[0] = turned;
    EXPECT_EQ(trust.holds_tracks(0), turned > 0.1);  // which take nothing back
    return trust.holds_colour(0);
  };
  EXPECT_FALSE(TextureTrust().holds_colour(0));
  EXPECT_FALSE(holds(0, 0.01));
  EXPECT_TRUE(holds(0.01, 0.2));
  EXPECT_TRUE(holds(-0.1, 0.2));
  EXPECT_FALSE(holds(0.1, 0.2));
}

std::vector<SymmetricEigen<3, double>> stiffness_of(const Surfels& surfels) {
  Motion motion = turned_by(Vec3<double>(0));
  return PoseSolver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, Vec3<double>(0), false)})
      .turn_stiffness({0.5F, 0.3F, {0.0F}});
}

// A ball turns freely about all axes, a spindle about its own, and what has three lengths about none.
TEST(TextureTrust, LooseTurnsAreThoseOfTheShape) {
  const auto turns = [](const Vec3<double>& by) {
    return TextureTrust().loose_turns(stiffness_of(stretched_ball(by)))[0];
  };
  EXPECT_EQ(turns(Vec3<double>(1)), Mat3<double>(1));
  const Mat3<double> spindle = turns({0.6, 1.4, 0.6});
  EXPECT_GT(spindle[1][1], 0.98);
  EXPECT_NEAR(spindle[0][0] + spindle[1][1] + spindle[2][2], 1, 1e-9);
  EXPECT_EQ(turns({1.0, 0.5, 0.25}), Mat3<double>(0));
}

// One picture in which lumps of a ball pass for an edge does not stop its turns from being loose.
TEST(TextureTrust, LooseTurnsAreThoseOfTheMeanStiffness) {
  const std::vector<SymmetricEigen<3, double>> round = stiffness_of(ball()),
                                               stiff = stiffness_of(stretched_ball({1.0, 0.5, 0.25}));
  TextureTrust trust;
  for (int k = 0; k < 20; ++k) trust.add_stiffness(round);
  trust.add_stiffness(stiff);
  EXPECT_EQ(trust.loose_turns(stiff)[0], Mat3<double>(1));
}

// The camera goes around a ball. Where the ball shows a direction from the second place is found on it step
// by step, and the rotation of all these places by a fit of points.
TEST(MirrorImage, TurnsWithTheCamera) {
  const BodySurface surface = draw_bodies(picture_of(ball(), Vec3<double>(0), false).camera,
                                          turned_by(Vec3<double>(0)), 0, ball(), {});
  const Vec3<double> first(surface.camera.position), shift(0.1, -0.05, 0.02);
  const Vec4<double> around = quaternion_exp(Vec3<double>(0.02, 0.08, 0));
  const Vec3<double> second = centre + rotation_from_quaternion(around) * (first - centre);
  std::vector<Vec3<double>> from, to;
  for (const SurfacePoint& point : surface.points) {
    if (point.body < 0) continue;
    const Vec3<double> n = normalize(Vec3<double>(point.position) - centre);
    const Vec3<double> to_eye = normalize(first - Vec3<double>(point.position));
    if (dot(n, to_eye) < 0.3) continue;
    const Vec3<double> mirrored = 2 * dot(n, to_eye) * n - to_eye;
    Vec3<double> then = n;
    for (int step = 0; step < 20; ++step)
      then = normalize(mirrored + normalize(second - (centre + shift + radius * then)));
    // With their opposites, so that they turn about the ball's centre.
    from.insert(from.end(), {n, -n});
    to.insert(to.end(), {then, -then});
  }
  ASSERT_GT(from.size(), 500U);
  const Mat3<double> fitted = fit_similarity(from, to).rotation;
  const Vec3<double> expected = 0.5 * Vec3<double>(fitted[1][2] - fitted[2][1], fitted[2][0] - fitted[0][2],
                                                   fitted[0][1] - fitted[1][0]);
  const Vec3<double> found = turn_of_mirror_image(surface, 0, second, shift);
  EXPECT_GT(glm::length(expected), 0.02);
  EXPECT_LT(glm::length(found - expected), 0.15 * glm::length(expected));
  EXPECT_LT(glm::length(turn_of_mirror_image(surface, 0, first, Vec3<double>(0))), 1e-6);
  EXPECT_EQ(turn_of_mirror_image(surface, 1, second, shift), Vec3<double>(0));
}

// What turns as mirror images do mirrors, once there were enough turns; what stands still or turns otherwise
// does not. One time at which photographs err does not change that.
TEST(TextureTrust, FindsMirrorsByTheirPhotographs) {
  const Vec3<double> image(0.02, 0.05, 0);
  const auto mirrors = [&](const Vec3<double>& seen, int times) {
    TextureTrust trust = TextureTrust::of(1);
    for (int k = 0; k < times; ++k) trust.add_turn(0, image, seen);
    trust.add_turn(0, image, Vec3<double>(0.5));
    return trust.mirrors(0);
  };
  EXPECT_FALSE(TextureTrust().mirrors(0));
  EXPECT_TRUE(mirrors(0.8 * image, 20));
  EXPECT_FALSE(mirrors(0.8 * image, 2));
  EXPECT_FALSE(mirrors(Vec3<double>(0), 20));
  EXPECT_FALSE(mirrors(Vec3<double>(-0.03, 0.02, 0.04), 20));
  TextureTrust trust = TextureTrust::of(1);
  for (int k = 0; k < 20; ++k) trust.add_turn(0, image, image);
  const LooseTurns loose = trust.without_mirrors({Mat3<double>(1)});
  EXPECT_EQ(loose[0], Mat3<double>(0));
}

}  // namespace
}  // namespace traceflow

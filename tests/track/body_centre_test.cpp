#include "track/body_centre.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/rotation.h"
#include "track/ball_body.h"

namespace traceflow {
namespace {

// Wherever a ball turns about so far.
TEST(BodyCentre, SilhouettesTellTheCentreOfABall) {
  Surfels ball = ball_body::ball();
  ball.log_scale.fill(std::log(0.03F));  // no gaps between surfels
  for (const Vec3<double>& off :
       {Vec3<double>(0), Vec3<double>(0.2, -0.1, 0.05), Vec3<double>(0, 0.15, -0.3)}) {
    for (const float normal : {0.0F, 0.3F}) {
      Motion motion = ball_body::turned_by(Vec3<double>(0));
      store3(motion.centre.row(0), ball_body::centre + off);
      PoseSolver solver(ball, nullptr, motion, 0, {}, {ball_body::picture_of(ball, Vec3<double>(0), false)});
      const Vec3<double> found = solver.turn_centres({0.5F, normal, {0.0F}, {}})[0];
      EXPECT_LT(glm::length(found - ball_body::centre), 0.05 * ball_body::radius)
          << found.x << " " << found.y << " " << found.z << " normals " << normal;
    }
  }
}

// A body that turns about another point and is shifted as much moves as before.
TEST(BodyCentre, PointsStayWhereTheyAreWhenItMoves) {
  Tensor<float> centres({2, 3});
  store3(centres.row(0), Vec3<double>(0.1, 0.2, 2));
  store3(centres.row(1), Vec3<double>(-1, 0, 3));
  Motion motion = still_motion(centres, tensor_of(std::vector<float>{0, 0.5F, 1}));
  for (int64_t i = 0; i < motion.rotation.size(); ++i)
    motion.rotation[i] += 0.3F * std::sin(3 * static_cast<float>(i) + 1);
  for (int64_t i = 0; i < motion.shift.size(); ++i)
    motion.shift[i] = 0.4F * std::cos(5 * static_cast<float>(i));
  Motion moved = motion;
  move_centre(1, Vec3<double>(0.5, -0.7, 2.5), moved);
  const auto place = [](const Motion& of, int64_t body, int64_t key, const Vec3<double>& x) {
    const Vec3<double> centre = load3<double>(of.centre.row(body));
    return rotation_from_quaternion(load4<double>(&of.rotation(body, key, 0))) * (x - centre) + centre +
           load3<double>(&of.shift(body, key, 0));
  };
  EXPECT_NEAR(moved.centre(1, 1), -0.7, 1e-6);
  for (int64_t body = 0; body < 2; ++body) {
    for (int64_t key = 0; key < 3; ++key) {
      for (const Vec3<double>& x : {Vec3<double>(0, 0, 0), Vec3<double>(1, -2, 0.5)})
        EXPECT_LT(glm::length(place(moved, body, key, x) - place(motion, body, key, x)), 1e-5);
    }
  }
}

}  // namespace
}  // namespace traceflow

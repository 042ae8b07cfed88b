#include "track/point_distance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "track/ball_body.h"

namespace traceflow {
namespace {

using ball_body::centre, ball_body::radius;

struct BallAndPoints {
  BodySurface surface;
  Tensor<float> points;
};

// Points of the whole ball, with noise, and as many of a wall behind it, where they are when the ball as it
// is drawn is `larger` times as large and as far as it should be. The camera is at the origin.
BallAndPoints drawn_larger(double larger, int64_t count) {
  Surfels ball = ball_body::ball();
  ball.log_scale.fill(std::log(0.03F));  // no gaps between surfels
  BallAndPoints result;
  const Camera<float> camera = ball_body::picture_of(ball, Vec3<double>(0), false).camera;
  result.surface = draw_bodies(camera, ball_body::turned_by(Vec3<double>(0)), 0, ball, {});
  result.points.reset({2 * count, 3});
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int64_t i = 0; i < count; ++i) {
    const Vec3<double> n = normalize(Vec3<double>(normal(random), normal(random), normal(random)));
    const Vec3<double> noise(normal(random), normal(random), normal(random));
    store3(result.points.row(i), (centre + radius * n) / larger + 0.01 * noise);
    store3(result.points.row(count + i), Vec3<double>(0.3 * n.x, 0.3 * n.y, 1) * 3.0);
  }
  return result;
}

// Flat surfels lie a little behind the ball's surface.
TEST(PointDistance, IsThatOfThePointsInFront) {
  const auto ratio = [](double larger) {
    const auto [surface, points] = drawn_larger(larger, 2000);
    return distance_by_points(surface, points, 1)[0];
  };
  EXPECT_NEAR(ratio(1), 1, 0.015);
  for (const double larger : {0.96, 1.03}) EXPECT_NEAR(ratio(larger) / ratio(1), 1 / larger, 0.003) << larger;
}

TEST(PointDistance, FewPointsTellNothing) {
  const auto [surface, points] = drawn_larger(1.03, 40);
  EXPECT_EQ(distance_by_points(surface, points, 1)[0], 1);
  EXPECT_EQ(distance_by_points(surface, Tensor<float>(), 1)[0], 1);
}

}  // namespace
}  // namespace traceflow

#include "viz/cameras/look_at.h"

#include <gtest/gtest.h>

#include <cmath>

namespace traceflow::viz {
namespace {

Camera<float> standing(const Vec3<double>& from, const Vec3<double>& forward) {
  return looking(Camera<float>(), from, forward, {0, -1, 0});
}

// A tenth of -1 added up ten times is more than -1: the mean of their places is ahead of them all.
TEST(Aim, OfCamerasAtOnePlaceIsAheadOfThem) {
  const Aim aim = aim_of(std::vector<Camera<float>>(10, standing({-1, 0, 0}, {1, 0, 0})));
  EXPECT_EQ(aim.spread, 1);
  EXPECT_NEAR(length(aim.target), 0, 1e-9);
}

TEST(Aim, OfParallelAxesIsAheadOfTheMiddle) {
  std::vector<Camera<float>> wall, oblique;
  wall.reserve(10);
  oblique.reserve(5);
  for (int i = 0; i < 10; ++i) wall.push_back(standing({-1, 1.0 * i, 0}, {1, 0, 0}));
  for (int i = 0; i < 5; ++i) oblique.push_back(standing({7 + 0.3 * i, -3, 0.1 * i}, {0.6, 0, 0.8}));
  const Aim aim = aim_of(wall);
  EXPECT_NEAR(aim.spread, 4.5, 1e-9);
  EXPECT_NEAR(length(aim.target - Vec3<double>(3.5, 4.5, 0)), 0, 1e-9);
  const Aim other = aim_of(oblique);
  EXPECT_NEAR(length(other.target - Vec3<double>(7.6 + 0.6, -3, 0.2 + 0.8)), 0, 1e-5);
}

TEST(Aim, OfAnArcIsItsCentreHoweverSmallTheArcAndFarFromTheOrigin) {
  const Vec3<double> centre(5, -2, 1);
  for (const double radius : {3.0, 1e-3}) {
    std::vector<Camera<float>> arc;
    for (int i = -4; i <= 4; ++i) {
      const Vec3<double> outward(std::sin(0.3 * i), 0, -std::cos(0.3 * i));
      arc.push_back(standing(centre + radius * outward, -outward));
    }
    EXPECT_NEAR(length(aim_of(arc).target - centre), 0, 5e-6) << radius;
  }
}

}  // namespace
}  // namespace traceflow::viz

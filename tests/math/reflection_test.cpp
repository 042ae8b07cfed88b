#include "math/reflection.h"

#include <gtest/gtest.h>

#include <limits>

#include "math/finite_differences.h"
#include "math/random_vector.h"

namespace traceflow {
namespace {

TEST(Reflection, OfARayThatMeetsAFloor) {
  EXPECT_LT(
      length(reflect(Vec3<double>(3, -3, 0), Vec3<double>(0, 5, 0)) - Vec3<double>(1, 1, 0) / std::sqrt(2.0)),
      1e-15);
}

TEST(Reflection, DoesNotSeeWhichWayTheNormalPoints) {
  Random random(3);
  const Vec3<double> ray = random_vector(random), normal = random_vector(random);
  EXPECT_LT(length(reflect(ray, normal) - reflect(ray, -normal)), 1e-15);
}

TEST(Reflection, BackwardMatchesCentralDifferences) {
  Random random(4);
  Vec3<double> ray = random_vector(random), normal = random_vector(random);
  const Vec3<double> weight = random_vector(random);
  const auto value = [&] { return dot(weight, reflect(ray, normal)); };
  const auto gradient = reflect_backward(ray, normal, weight);
  for (int axis = 0; axis < 3; ++axis) {
    expect_derivative(gradient.ray[axis], ray[axis], value, "ray");
    expect_derivative(gradient.normal[axis], normal[axis], value, "normal");
  }
}

TEST(Reflection, WithoutADirectionIsZero) {
  const Vec3<float> some(1, 2, 3), none(0), endless(std::numeric_limits<float>::infinity(), 0, 0);
  for (const Vec3<float>& bad : {none, endless}) {
    EXPECT_EQ(reflect(some, bad), none);
    EXPECT_EQ(reflect(bad, some), none);
    EXPECT_EQ(reflect_backward(some, bad, some).ray, none);
    EXPECT_EQ(reflect_backward(bad, some, some).normal, none);
  }
}

}  // namespace
}  // namespace traceflow

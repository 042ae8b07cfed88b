#include "math/rotation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "math/finite_differences.h"

namespace traceflow {
namespace {

Vec4<double> random_quaternion(Random& random) {
  return {random.normal(), random.normal(), random.normal(), random.normal()};
}

TEST(Rotation, is_a_rotation_for_any_length_of_quaternion) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const auto r = rotation_from_quaternion(std::exp(random.normal()) * random_quaternion(random));
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) EXPECT_NEAR(dot(r[a], r[b]), a == b ? 1 : 0, 1e-14);
    }
    EXPECT_NEAR(determinant(r), 1, 1e-14);
  }
}

TEST(Rotation, turns_by_the_quaternion_s_angle_about_its_axis) {
  // A quarter turn about z takes x to y.
  const auto r = rotation_from_quaternion(Vec4<double>(std::sqrt(0.5), 0, 0, std::sqrt(0.5)));
  EXPECT_NEAR(length(r * Vec3<double>(1, 0, 0) - Vec3<double>(0, 1, 0)), 0, 1e-15);
}

TEST(Rotation, of_a_zero_quaternion_is_the_identity_and_passes_no_gradient) {
  EXPECT_EQ(rotation_from_quaternion(Vec4<double>(0.0)), Mat3<double>(1.0));
  EXPECT_EQ(rotation_from_quaternion_backward(Vec4<double>(0.0), Mat3<double>(1.0)), Vec4<double>(0.0));
}

TEST(Rotation, backward_matches_central_differences) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    auto q = random_quaternion(random);
    Mat3<double> g;
    for (int a = 0; a < 3; ++a) g[a] = {random.normal(), random.normal(), random.normal()};
    const auto loss = [&] {
      const auto r = rotation_from_quaternion(q);
      return dot(g[0], r[0]) + dot(g[1], r[1]) + dot(g[2], r[2]);
    };
    const auto grad = rotation_from_quaternion_backward(q, g);
    for (int a = 0; a < 4; ++a) expect_derivative(grad[a], q[a], loss, "quaternion");
  }
}

}  // namespace
}  // namespace traceflow

#include "math/pseudo_normal.h"

#include <gtest/gtest.h>

#include "math/finite_differences.h"
#include "math/random_vector.h"

namespace traceflow {
namespace {

// The wall z = 3 before a camera at the origin: x(right) − x(left) points right, x(below) − x(above) down.
TEST(PseudoNormal, FacesTheCamera) {
  EXPECT_EQ(pseudo_normal(Vec3<double>(2, 0, 0), Vec3<double>(0, 2, 0)), Vec3<double>(0, 0, -1));
}

TEST(PseudoNormal, IsUprightOnBothEdges) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Vec3<double> across = random_vector(random), down = random_vector(random);
    const Vec3<double> n = pseudo_normal(across, down);
    EXPECT_NEAR(length(n), 1, 1e-14);
    EXPECT_NEAR(dot(n, across), 0, 1e-13);
    EXPECT_NEAR(dot(n, down), 0, 1e-13);
  }
}

TEST(PseudoNormal, BackwardMatchesCentralDifferences) {
  Random random(2);
  Vec3<double> across = random_vector(random), down = random_vector(random);
  const Vec3<double> weight = random_vector(random);
  const auto value = [&] { return dot(weight, pseudo_normal(across, down)); };
  const auto gradient = pseudo_normal_backward(across, down, weight);
  for (int axis = 0; axis < 3; ++axis) {
    expect_derivative(gradient.across[axis], across[axis], value, "across");
    expect_derivative(gradient.down[axis], down[axis], value, "down");
  }
}

TEST(PseudoNormal, OfEdgesThatSpanNothingIsZero) {
  const Vec3<float> edge(1, 2, 3), huge(3e38F, 1, 1);
  EXPECT_EQ(pseudo_normal(edge, edge), Vec3<float>(0));
  EXPECT_EQ(pseudo_normal(edge, Vec3<float>(0)), Vec3<float>(0));
  EXPECT_EQ(pseudo_normal(edge, huge), Vec3<float>(0));
  EXPECT_EQ(pseudo_normal_backward(edge, huge, edge).across, Vec3<float>(0));
}

}  // namespace
}  // namespace traceflow

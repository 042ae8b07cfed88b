#include "ops/environment_map/environment_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "base/random.h"
#include "math/cube_map.h"

namespace traceflow::environment_map {
namespace {

template <class T>
Tensor<T> noise(const Shape& shape, uint64_t seed) {
  Random random(seed);
  Tensor<T> t(shape);
  for (T& v : t.values()) v = static_cast<T>(random.normal());
  return t;
}

TEST(CubeMap, EveryAxisMeetsTheMiddleOfItsOwnFace) {
  for (int face = 0; face < 6; ++face) {
    Vec3<double> d(0);
    d[face / 2] = face % 2 ? -3 : 3;
    const auto at = cube_coordinates(d);
    EXPECT_EQ(at.face, face);
    EXPECT_DOUBLE_EQ(at.s, 0.5);
    EXPECT_DOUBLE_EQ(at.t, 0.5);
  }
}

TEST(CubeMap, NeighbouringFacesMeetAlongTheirEdges) {
  // The two faces beside every edge direction see it on their own borders.
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    Vec3<double> d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const int axis = i % 3;
    d[axis] = d[axis] < 0 ? -1 : 1;
    d[(axis + 1) % 3] = d[(axis + 1) % 3] < 0 ? -1 : 1;
    const auto at = cube_coordinates(d);
    const double to_border = std::min({at.s, 1 - at.s, at.t, 1 - at.t});
    EXPECT_NEAR(to_border, 0, 1e-12);
  }
}

TEST(EnvironmentMap, AConstantMapLooksTheSameEverywhere) {
  Tensor<float> logit(Shape{24, 4, 3});
  logit.fill(1.5F);
  const Tensor<float> directions = noise<float>({500, 3}, 2);
  Tensor<float> colour;
  forward(logit, directions, colour);
  for (const float v : colour.values()) EXPECT_NEAR(v, 1 / (1 + std::exp(-1.5F)), 1e-6F);
}

TEST(EnvironmentMap, SinglePrecisionAgreesWithDouble) {
  const Tensor<double> logit = noise<double>({6 * 7, 7, 3}, 3);
  const Tensor<double> directions = noise<double>({4000, 3}, 4);
  Tensor<double> expected;
  forward(logit, directions, expected);
  Tensor<float> found;
  forward(convert<float>(logit), convert<float>(directions), found);
  for (int64_t i = 0; i < found.size(); ++i)
    ASSERT_NEAR(static_cast<double>(found[i]), expected[i], 2e-4) << i;
}

TEST(EnvironmentMap, GradientAgreesWithCentralDifferences) {
  Tensor<double> logit = noise<double>({6 * 5, 5, 3}, 5);
  Tensor<double> directions = noise<double>({60, 3}, 6);
  const Tensor<double> grad_colour = noise<double>({60, 3}, 7);
  Tensor<double> grad_logit(logit.shape());
  Tensor<double> grad_directions(directions.shape());
  backward(logit, directions, grad_colour, grad_logit, grad_directions);
  const auto loss = [&] {
    Tensor<double> colour;
    forward(logit, directions, colour);
    double sum = 0;
    for (int64_t i = 0; i < colour.size(); ++i) sum += colour[i] * grad_colour[i];
    return sum;
  };
  const auto check = [&](Tensor<double>& x, const Tensor<double>& gradient) {
    for (int64_t i = 0; i < x.size(); ++i) {
      const double start = x[i];
      x[i] = start + 1e-6;
      const double up = loss();
      x[i] = start - 1e-6;
      const double down = loss();
      x[i] = start;
      ASSERT_NEAR((up - down) / 2e-6, gradient[i], 1e-6 * (1 + std::abs(gradient[i]))) << i;
    }
  };
  check(logit, grad_logit);
  check(directions, grad_directions);
}

TEST(EnvironmentMap, UnusableDirectionsSeeBlackAndPassNothing) {
  const Tensor<float> logit = noise<float>({12, 2, 3}, 8);
  Tensor<float> directions(Shape{3, 3});
  directions(1, 0) = std::numeric_limits<float>::quiet_NaN();
  directions(2, 1) = std::numeric_limits<float>::infinity();
  Tensor<float> colour;
  forward(logit, directions, colour);
  for (const float v : colour.values()) EXPECT_EQ(v, 0);
  Tensor<float> grad_logit(logit.shape());
  Tensor<float> grad_directions(directions.shape());
  Tensor<float> ones(directions.shape());
  ones.fill(1);
  backward(logit, directions, ones, grad_logit, grad_directions);
  for (const float v : grad_logit.values()) EXPECT_EQ(v, 0);
  for (const float v : grad_directions.values()) EXPECT_EQ(v, 0);
}

TEST(EnvironmentMap, NoRaysIsFine) {
  Tensor<float> colour;
  forward(noise<float>({12, 2, 3}, 9), Tensor<float>(Shape{0, 3}), colour);
  EXPECT_EQ(colour.size(), 0);
}

TEST(EnvironmentMap, SameBytesAtAnyThreadCount) {
  const Tensor<float> logit = noise<float>({6 * 8, 8, 3}, 10);
  const Tensor<float> directions = noise<float>({30000, 3}, 11);
  Tensor<float> results[2];
  for (int threads = 1; threads <= 2; ++threads) {
    set_threads(threads);
    Tensor<float>& grad_logit = results[threads - 1];
    grad_logit.reset(logit.shape());
    Tensor<float> grad_directions(directions.shape());
    backward(logit, directions, noise<float>(directions.shape(), 12), grad_logit, grad_directions);
  }
  set_threads(0);
  for (int64_t i = 0; i < results[0].size(); ++i) ASSERT_EQ(results[0][i], results[1][i]);
}

}  // namespace
}  // namespace traceflow::environment_map

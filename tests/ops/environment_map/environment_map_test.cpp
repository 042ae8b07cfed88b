#include "ops/environment_map/environment_map.h"

#include <array>
#include <limits>

#include "math/cube_map.h"
#include "support/gradients.h"

namespace traceflow::environment_map {
namespace {

using namespace traceflow::testing;

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
    Vec3<double> d{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
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

// Oracle: a direction through a texel's centre sees that texel and no other.
TEST(EnvironmentMap, ADirectionThroughATexelSeesThatTexel) {
  constexpr int64_t size = 4;
  const Tensor<double> logit = noise<double>({6 * size, size, 3}, 12);
  Tensor<double> directions(Shape{6 * size * size, 3});
  for (int64_t i = 0; i < directions.dim(0); ++i) {
    const CubeFace face = cube_face(static_cast<int>(i / (size * size)));
    const double s = (static_cast<double>(i % size) + 0.5) / size,
                 t = (static_cast<double>(i / size % size) + 0.5) / size;
    double* d = directions.row(i);
    d[face.major] = i / (size * size) % 2 ? -2 : 2;
    d[face.axis_s] = 2 * face.sign_s * (2 * s - 1);
    d[face.axis_t] = 2 * face.sign_t * (2 * t - 1);
  }
  Tensor<double> colour;
  forward(logit, directions, colour);
  for (int64_t i = 0; i < colour.size(); ++i) EXPECT_NEAR(colour[i], 1 / (1 + std::exp(-logit[i])), 1e-12);
}

TEST(EnvironmentMap, SinglePrecisionAgreesWithDouble) {
  const auto logit = convert<float>(noise<double>({6 * 7, 7, 3}, 3));
  const auto directions = convert<float>(noise<double>({4000, 3}, 4));
  const auto grad_colour = convert<float>(noise<double>({4000, 3}, 5));
  Tensor<double> expected, grad_logit({42, 7, 3}), grad_directions({4000, 3});
  forward(convert<double>(logit), convert<double>(directions), expected);
  backward(convert<double>(logit), convert<double>(directions), convert<double>(grad_colour), grad_logit,
           grad_directions);
  Tensor<float> found, found_logit(grad_logit.shape()), found_directions(grad_directions.shape());
  forward(logit, directions, found);
  backward(logit, directions, grad_colour, found_logit, found_directions);
  expect_close(found, expected, 1e-5, "colour");
  expect_close(found_logit, grad_logit, 1e-4, "logit");
  expect_close(found_directions, grad_directions, 1e-4, "directions");
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

// Directions on edges and corners, of any length that a number can have, and maps of one texel a face:
// nothing is read or written outside the map (for sanitizers to see), and colours stay within the logits'
// range.
TEST(EnvironmentMap, ExtremeDirectionsStayInsideTheMap) {
  for (const int64_t size : {1, 2, 5}) {
    const Tensor<float> logit = noise<float>({6 * size, size, 3}, 8);
    Tensor<float> directions(Shape{125, 3});
    const std::array<float, 5> values{-1, 0, 1, 1e-45F, 3e38F};
    for (size_t i = 0; i < 125; ++i) {
      float* d = directions.row(static_cast<int64_t>(i));
      d[0] = values[i % 5];
      d[1] = values[i / 5 % 5];
      d[2] = values[i / 25];
    }
    Tensor<float> colour, grad_logit(logit.shape()), grad_directions(directions.shape());
    forward(logit, directions, colour);
    backward(logit, directions, noise<float>(directions.shape(), 3), grad_logit, grad_directions);
    EXPECT_TRUE(all_finite(colour) && all_finite(grad_logit) && all_finite(grad_directions));
  }
}

TEST(EnvironmentMap, ABadGradientOrTexelPoisonsNoOther) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  Tensor<float> logit = noise<float>({30, 5, 3}, 8);
  const Tensor<float> directions = noise<float>({500, 3}, 9);
  Tensor<float> grad_colour = noise<float>({500, 3}, 10);
  grad_colour[7] = nan;
  logit[0] = nan;
  Tensor<float> grad_logit(logit.shape()), grad_directions(directions.shape());
  backward(logit, directions, grad_colour, grad_logit, grad_directions);
  EXPECT_TRUE(all_finite(grad_logit) && all_finite(grad_directions));
}

TEST(EnvironmentMap, RefusesShapesThatDoNotFit) {
  Tensor<float> colour;
  EXPECT_THROW(forward(Tensor<float>({5, 1, 3}), Tensor<float>({1, 3}), colour), InternalError);
  EXPECT_THROW(forward(Tensor<float>(), Tensor<float>({1, 3}), colour), InternalError);
  EXPECT_THROW(forward(Tensor<float>({6, 1, 3}), Tensor<float>({3}), colour), InternalError);
}

TEST(EnvironmentMap, NoRaysIsFine) {
  Tensor<float> colour;
  forward(noise<float>({12, 2, 3}, 9), Tensor<float>(Shape{0, 3}), colour);
  EXPECT_EQ(colour.size(), 0);
}

TEST(EnvironmentMap, SameBytesAtAnyThreadCount) {
  const Tensor<float> logit = noise<float>({6 * 8, 8, 3}, 10);
  const Tensor<float> directions = noise<float>({30000, 3}, 11);
  expect_same_bytes_at_any_thread_count([&] {
    Tensor<float> colour, grad_logit(logit.shape()), grad_directions(directions.shape());
    forward(logit, directions, colour);
    backward(logit, directions, noise<float>(directions.shape(), 12), grad_logit, grad_directions);
    return std::vector{colour, grad_logit, grad_directions};
  });
}

}  // namespace
}  // namespace traceflow::environment_map

#include "splat/gaussians.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "math/rotation.h"
#include "splat/random_surfels.h"

namespace traceflow {
namespace {

Mat3<double> covariance(const float* rotation, double u, double v, double n) {
  const Mat3<double> r =
      rotation_from_quaternion(Vec4<double>(rotation[0], rotation[1], rotation[2], rotation[3]));
  Mat3<double> scaled = r;
  scaled[0] *= u * u;
  scaled[1] *= v * v;
  scaled[2] *= n * n;
  return scaled * transpose(r);
}

// Oracle: a Gaussian's covariance does not depend on the order of its axes.
TEST(Flatten, TheShortestAxisBecomesTheNormal) {
  const int64_t n = 300;
  Surfels s = random_surfels(n, 1, false);
  const Tensor<float> rotation_before = s.rotation;
  Tensor<float> log_scales(Shape{n, 3});
  Random random(3);
  for (float& v : log_scales.values()) v = static_cast<float>(random.normal());
  flatten(log_scales, s);
  for (int64_t i = 0; i < n; ++i) {
    const float* l = log_scales.row(i);
    const float shortest = *std::min_element(l, l + 3);
    const auto before = covariance(rotation_before.row(i), std::exp(double{l[0]}), std::exp(double{l[1]}),
                                   std::exp(double{l[2]}));
    const auto after = covariance(s.rotation.row(i), std::exp(double{s.log_scale(i, 0)}),
                                  std::exp(double{s.log_scale(i, 1)}), std::exp(double{shortest}));
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r)
        EXPECT_NEAR(after[c][r], before[c][r], 1e-5 * (before[0][0] + before[1][1] + before[2][2]));
    }
    EXPECT_LE(shortest, std::min(s.log_scale(i, 0), s.log_scale(i, 1)));
  }
}

TEST(Flatten, KeepsThinGaussiansAsTheyAre) {
  Surfels s = random_surfels(50, 1, false);
  const Surfels before = s;
  Tensor<float> log_scales(Shape{50, 3});
  for (int64_t i = 0; i < 50; ++i) {
    log_scales(i, 0) = s.log_scale(i, 0);
    log_scales(i, 1) = s.log_scale(i, 1);
    log_scales(i, 2) = log_thickness(s, i);
    EXPECT_NEAR(std::exp(log_thickness(s, i) - std::min(s.log_scale(i, 0), s.log_scale(i, 1))), 0.01, 1e-6);
  }
  flatten(log_scales, s);
  EXPECT_TRUE(std::equal(s.rotation.values().begin(), s.rotation.values().end(), before.rotation.data()));
  EXPECT_TRUE(std::equal(s.log_scale.values().begin(), s.log_scale.values().end(), before.log_scale.data()));
}

}  // namespace
}  // namespace traceflow

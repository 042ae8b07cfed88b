#include "math/ssim.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "math/finite_differences.h"

namespace traceflow {
namespace {

// Moments of two windows with means, variances and covariance as given.
SsimMoments<double> moments(double mean_x, double mean_y, double variance_x, double variance_y,
                            double covariance) {
  return {mean_x, mean_y, variance_x + variance_y + mean_x * mean_x + mean_y * mean_y,
          covariance + mean_x * mean_y};
}

// Oracle: the formula as its authors wrote it.
TEST(Ssim, IsLuminanceTimesContrastAndStructure) {
  const double c1 = 1e-4, c2 = 9e-4;
  const auto found = ssim_with_derivative(moments(0.3, 0.5, 0.02, 0.03, 0.01)).value;
  EXPECT_NEAR(found, (2 * 0.15 + c1) / (0.09 + 0.25 + c1) * (2 * 0.01 + c2) / (0.02 + 0.03 + c2), 1e-14);
  EXPECT_NEAR(ssim_with_derivative(moments(0.4, 0.4, 0.02, 0.02, 0.02)).value, 1, 1e-13);
  EXPECT_LT(ssim_with_derivative(moments(0.4, 0.4, 0.02, 0.02, -0.02)).value, 0);
}

TEST(Ssim, DerivativeMatchesCentralDifferences) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    auto m = moments(random.uniform(), random.uniform(), 0.1 * random.uniform(), 0.1 * random.uniform(),
                     0.02 * random.normal());
    const auto value = [&] { return ssim_with_derivative(m).value; };
    const auto d = ssim_with_derivative(m);
    expect_derivative(d.by_mean_x, m.mean_x, value, "mean");
    expect_derivative(d.by_squares, m.squares, value, "squares");
    expect_derivative(d.by_product, m.product, value, "product");
  }
}

}  // namespace
}  // namespace traceflow

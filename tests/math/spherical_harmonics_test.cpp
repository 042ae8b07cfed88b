#include "math/spherical_harmonics.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "math/finite_differences.h"

namespace traceflow {
namespace {

constexpr int degree_max = 3;
constexpr int count_max = 16;

Vec3<double> random_direction(Random& random) {
  return normalize(Vec3<double>(random.normal(), random.normal(), random.normal()));
}

std::array<double, count_max> basis_at(const Vec3<double>& direction) {
  std::array<double, count_max> basis{};
  sh_basis(degree_max, direction, basis.data());
  return basis;
}

// f(direction, weight) over a rule that integrates polynomials of degree 7 and less over the sphere exactly:
// four Gauss points in z, eight equal angles around it.
template <class F>
void over_the_sphere(F&& f) {
  const double inner = std::sqrt(3.0 / 7 - 2.0 / 7 * std::sqrt(6.0 / 5)),
               outer = std::sqrt(3.0 / 7 + 2.0 / 7 * std::sqrt(6.0 / 5));
  const double inner_weight = (18 + std::sqrt(30.0)) / 36, outer_weight = (18 - std::sqrt(30.0)) / 36;
  for (const auto& [z, weight] : {std::pair{-outer, outer_weight},
                                  {-inner, inner_weight},
                                  {inner, inner_weight},
                                  {outer, outer_weight}}) {
    for (int k = 0; k < 8; ++k) {
      const double angle = (k + 0.5) * std::numbers::pi / 4;
      const double r = std::sqrt(1 - z * z);
      f(Vec3<double>(r * std::cos(angle), r * std::sin(angle), z), weight * std::numbers::pi / 4);
    }
  }
}

TEST(SphericalHarmonics, CoefficientsAndDegreesAreInverse) {
  for (int degree = 0; degree <= 3; ++degree) EXPECT_EQ(sh_degree(sh_coefficients(degree)), degree);
}

// Oracle: ∫ Y_a Y_b = 1 where a is b, else 0.
TEST(SphericalHarmonics, AreOrthonormal) {
  for (int a = 0; a < count_max; ++a) {
    for (int b = 0; b < count_max; ++b) {
      double integral = 0;
      over_the_sphere([&](const Vec3<double>& d, double weight) {
        const auto basis = basis_at(d);
        integral += weight * basis[static_cast<size_t>(a)] * basis[static_cast<size_t>(b)];
      });
      EXPECT_NEAR(integral, a == b ? 1 : 0, 1e-12) << a << ' ' << b;
    }
  }
}

// Oracle: the addition theorem. Σ_m Y_lm(x) Y_lm(y) = (2l + 1)/4π · P_l(x·y), which fixes each degree as a
// whole.
TEST(SphericalHarmonics, ObeyTheAdditionTheorem) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Vec3<double> x = random_direction(random), y = random_direction(random);
    const auto at_x = basis_at(x), at_y = basis_at(y);
    const double c = dot(x, y);
    const std::array<double, 4> legendre{1, c, (3 * c * c - 1) / 2, (5 * c * c * c - 3 * c) / 2};
    for (size_t l = 0; l <= static_cast<size_t>(degree_max); ++l) {
      double sum = 0;
      for (size_t k = l * l; k < (l + 1) * (l + 1); ++k) sum += at_x[k] * at_y[k];
      const auto orders = static_cast<double>(2 * l + 1);
      EXPECT_NEAR(sum, orders / (4 * std::numbers::pi) * legendre[l], 1e-12);
    }
  }
}

// 3DGS's own order and signs in degree 1, which files depend on: −y, z, −x.
TEST(SphericalHarmonics, DegreeOneHasTheOrderAndSignsOf3dgs) {
  const auto basis = basis_at({1, 10, 100});
  const double c = std::sqrt(3 / (4 * std::numbers::pi));
  EXPECT_NEAR(basis[1], -10 * c, 1e-12);
  EXPECT_NEAR(basis[2], 100 * c, 1e-12);
  EXPECT_NEAR(basis[3], -1 * c, 1e-12);
}

TEST(SphericalHarmonics, LowerDegreesAreTheBeginningOfHigherOnes) {
  Random random(2);
  const Vec3<double> d = random_direction(random);
  const auto all = basis_at(d);
  for (int degree = 0; degree <= degree_max; ++degree) {
    std::array<double, count_max + 1> basis{};
    basis.fill(-7);
    sh_basis(degree, d, basis.data());
    for (size_t k = 0; k < basis.size(); ++k) {
      const bool filled = k < static_cast<size_t>(sh_coefficients(degree));
      EXPECT_EQ(basis[k], filled ? all[k] : -7);
    }
  }
}

TEST(SphericalHarmonics, BasisBackwardMatchesCentralDifferences) {
  Random random(3);
  for (int degree = 0; degree <= degree_max; ++degree) {
    Vec3<double> d = 1.3 * random_direction(random);  // free, not on the sphere
    std::array<double, count_max> weight{};
    for (double& w : weight) w = random.normal();
    const auto value = [&] {
      std::array<double, count_max> basis{};
      sh_basis(degree, d, basis.data());
      double sum = 0;
      for (size_t k = 0; k < static_cast<size_t>(sh_coefficients(degree)); ++k) sum += weight[k] * basis[k];
      return sum;
    };
    const Vec3<double> gradient = sh_basis_backward(degree, d, weight.data());
    for (int axis = 0; axis < 3; ++axis) expect_derivative(gradient[axis], d[axis], value, "direction");
  }
}

TEST(SphericalHarmonics, ColourBackwardMatchesCentralDifferences) {
  Random random(4);
  for (int degree = 0; degree <= degree_max; ++degree) {
    Vec3<double> d = random_direction(random);
    std::array<double, 3 * count_max> sh{}, grad_sh{};
    for (double& v : sh) v = 0.2 * random.normal();
    sh[1] = -9;  // the second channel is clamped at zero
    const Vec3<double> weight(0.3, 0.5, -0.7);
    const auto value = [&] { return dot(weight, sh_colour(degree, sh.data(), d)); };
    const Vec3<double> gradient = sh_colour_backward(degree, sh.data(), d, weight, grad_sh.data());
    EXPECT_EQ(sh_colour(degree, sh.data(), d).y, 0);
    for (int axis = 0; axis < 3; ++axis) expect_derivative(gradient[axis], d[axis], value, "direction");
    for (size_t k = 0; k < sh.size(); ++k) expect_derivative(grad_sh[k], sh[k], value, "coefficient");
  }
}

// Oracle: the first coefficient alone is the colour's offset, as every exporter of 3DGS has it.
TEST(SphericalHarmonics, FirstCoefficientIsTheColourFromEverywhere) {
  const std::array<double, 3> sh{(0.25 - 0.5) / sh_c0, 0, (0.75 - 0.5) / sh_c0};
  Random random(5);
  const Vec3<double> colour = sh_colour(0, sh.data(), random_direction(random));
  EXPECT_NEAR(length(colour - Vec3<double>(0.25, 0.5, 0.75)), 0, 1e-15);
}

}  // namespace
}  // namespace traceflow

#include "ops/loss/loss.h"

#include <functional>
#include <limits>

#include "support/gradients.h"
#include "support/loss_values.h"

namespace traceflow::loss {
namespace {

using namespace traceflow::testing;

constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

// Normals of every length up to one, and unit normals to compare them with; every seventh of either is
// missing.
struct Normals {
  Tensor<double> blended, unit, alpha;

  Normals(int64_t height, int64_t width) {
    Random random(1);
    blended = random_tensor<double>({height, width, 3}, random, -0.5, 0.5);
    unit = random_tensor<double>({height, width, 3}, random, -1, 1);
    alpha = random_tensor<double>({height, width}, random, 0, 1);
    for (int64_t i = 0; i < height * width; ++i) {
      double* u = unit.data() + 3 * i;
      const double length = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
      for (int c = 0; c < 3; ++c) u[c] = i % 7 == 3 ? 0 : u[c] / length;
      if (i % 7 == 5) std::fill_n(blended.data() + 3 * i, 3, 0.0);
    }
  }
};

TEST(L1, IsTheMeanDistance) {
  Tensor<float> image({2, 1, 3}), target({2, 1, 3}), gradient({2, 1, 3});
  for (int64_t i = 0; i < 6; ++i) image[i] = static_cast<float>(i);
  target.fill(2);
  EXPECT_DOUBLE_EQ(l1(image, target, 12, gradient), 9.0 / 6);
  for (int64_t i = 0; i < 6; ++i) EXPECT_EQ(gradient[i], i < 2 ? -2 : i == 2 ? 0 : 2);
}

TEST(L1, FastAgreesWithReference) {
  for (const int64_t width : {1, 7, 60}) {
    Random random(2);
    const Shape shape{31, width, 3};
    const auto image = random_tensor<double>(shape, random, 0, 1),
               target = random_tensor<double>(shape, random, 0, 1);
    Tensor<float> fast(shape);
    Tensor<double> plain(shape);
    const double value = l1(convert<float>(image), convert<float>(target), 0.8, fast);
    EXPECT_NEAR(value, l1_reference(image, target, 0.8, plain), 1e-6);
    expect_close(fast, plain, 1e-6, "gradient");
  }
}

TEST(L1, GradientAgreesWithCentralDifferences) {
  Random random(3);
  auto image = random_tensor<double>({3, 4, 3}, random, 0, 1);
  const auto target = random_tensor<double>({3, 4, 3}, random, 0, 1);
  Tensor<double> gradient(image.shape()), unused(image.shape());
  l1_reference(image, target, 0.8, gradient);
  const auto value = [&] { return 0.8 * l1_reference(image, target, 1, unused); };
  expect_close(gradient, central_differences(image, value), 1e-8, "image");
}

TEST(NormalConsistency, IsZeroWhereTheyAgreeAndTwoWhereTheyOppose) {
  Tensor<float> normal({1, 2, 3}), alpha({1, 2}), pseudo({1, 2, 3}), a({1, 2, 3}), b({1, 2}), c({1, 2, 3});
  normal[2] = pseudo[2] = 1;
  alpha.fill(1);
  // The second pixel has no pseudo-normal.
  EXPECT_DOUBLE_EQ(normal_consistency(normal, alpha, pseudo, 1, a, b, c), 0);
  pseudo[2] = -1;
  EXPECT_DOUBLE_EQ(normal_consistency(normal, alpha, pseudo, 1, a, b, c), 1);  // half of the frame at 2
}

// Faint pixels do not gain by becoming opaque: over a background of their colour they would grow.
TEST(NormalConsistency, PrefersPixelsToBeEmptyOrOpaque) {
  const float shares[] = {0, 0.1F, 0.5F, 0.75F, 1};
  Tensor<float> normal({1, 5, 3}), alpha({1, 5}), pseudo({1, 5, 3}), a(normal.shape()), b(alpha.shape()),
      c(normal.shape());
  for (int64_t i = 0; i < 5; ++i) {
    alpha[i] = normal[3 * i] = shares[i];  // hits with the unit normal (1, 0, 0) and these weights
    pseudo[3 * i] = 1;
  }
  // At each pixel min(α, 1 − α).
  EXPECT_NEAR(normal_consistency(normal, alpha, pseudo, 5, a, b, c), (0.1 + 0.5 + 0.25) / 5, 1e-7);
  for (int64_t i = 0; i < 5; ++i) {
    const float by_weight = b[i] + a[3 * i];  // dL/dw of such a hit
    EXPECT_NEAR(by_weight, shares[i] < 0.5F ? 1 : -1, 1e-6) << "pixel " << i;
  }
}

TEST(NormalConsistency, FastAgreesWithReference) {
  const Normals n(40, 50);
  const Shape shape = n.unit.shape();
  Tensor<float> a(shape), b(n.alpha.shape()), c(shape);
  Tensor<double> d(shape), e(n.alpha.shape()), f(shape);
  const double value = normal_consistency(convert<float>(n.blended), convert<float>(n.alpha),
                                          convert<float>(n.unit), 0.05, a, b, c);
  EXPECT_NEAR(value, normal_consistency_reference(n.blended, n.alpha, n.unit, 0.05, d, e, f), 1e-6);
  expect_close(a, d, 1e-6, "normal");
  expect_close(b, e, 1e-6, "alpha");
  expect_close(c, f, 1e-6, "pseudo-normal");
}

TEST(NormalConsistency, GradientAgreesWithCentralDifferences) {
  Normals n(5, 6);
  const Shape shape = n.unit.shape();
  Tensor<double> grad_normal(shape), grad_alpha(n.alpha.shape()), grad_pseudo(shape), unused(shape),
      unused_alpha(n.alpha.shape());
  normal_consistency_reference(n.blended, n.alpha, n.unit, 0.05, grad_normal, grad_alpha, grad_pseudo);
  const auto value = [&] {
    return 0.05 * normal_consistency_reference(n.blended, n.alpha, n.unit, 1, unused, unused_alpha, unused);
  };
  expect_close(grad_normal, central_differences(n.blended, value), 1e-7, "normal");
  expect_close(grad_alpha, central_differences(n.alpha, value), 1e-7, "alpha");
  // A pixel without a pseudo-normal is left out; giving it one is a discontinuity, not a gradient.
  auto differences = central_differences(n.unit, value);
  for (int64_t i = 0; i < 30; ++i) {
    if (i % 7 == 3) std::fill_n(differences.data() + 3 * i, 3, 0.0);
  }
  expect_close(grad_pseudo, differences, 1e-7, "pseudo-normal");
}

TEST(NormalPrior, IsOneMinusTheMeanCosine) {
  Tensor<float> normal({1, 3, 3}), prior({1, 3, 3}), gradient({1, 3, 3});
  normal[2] = 0.25F;  // its length does not matter
  prior[2] = 0.6F;
  prior[0] = 0.8F;
  normal[3] = 1;  // no prior
  prior[7] = 1;   // no normal
  EXPECT_NEAR(normal_prior(normal, prior, 1, gradient), 0.4, 1e-7);
  for (int64_t i = 3; i < 9; ++i) EXPECT_EQ(gradient[i], 0);
  Tensor<float> tint({1, 3});
  EXPECT_NEAR(normal_prior(normal, prior, 1, gradient, tint, 7), 0.4, 1e-7);
  tint[0] = 0.5F;
  EXPECT_NEAR(normal_prior(normal, prior, 1, gradient, tint, 7), 1.6, 1e-6);
}

TEST(NormalPrior, FastAgreesWithReference) {
  const Normals n(40, 50);
  Random random(7);
  for (const Tensor<double>& tint : {Tensor<double>(), random_tensor<double>({40, 50}, random, 0, 1)}) {
    Tensor<float> fast(n.unit.shape());
    Tensor<double> plain(n.unit.shape());
    const double value =
        normal_prior(convert<float>(n.blended), convert<float>(n.unit), 0.05, fast, convert<float>(tint), 7);
    EXPECT_NEAR(value, normal_prior_reference(n.blended, n.unit, tint, 7, 0.05, plain), 1e-6);
    expect_close(fast, plain, 1e-5, "normal");
  }
}

TEST(NormalPrior, GradientAgreesWithCentralDifferences) {
  Normals n(5, 6);
  Random random(7);
  const Tensor<double> tint = random_tensor<double>({5, 6}, random, 0, 1);
  Tensor<double> gradient(n.unit.shape()), unused(n.unit.shape());
  normal_prior_reference(n.blended, n.unit, tint, 7, 0.05, gradient);
  const auto value = [&] { return 0.05 * normal_prior_reference(n.blended, n.unit, tint, 7, 1, unused); };
  auto differences = central_differences(n.blended, value);
  for (int64_t i = 0; i < 30; ++i) {  // a missing normal is a discontinuity
    if (i % 7 == 5) std::fill_n(differences.data() + 3 * i, 3, 0.0);
  }
  expect_close(gradient, differences, 1e-7, "normal");
}

TEST(Distortion, IsTheMeanOfItsMap) {
  Tensor<float> map({3, 4}), gradient({3, 4});
  for (int64_t i = 0; i < 12; ++i) map[i] = static_cast<float>(i);
  EXPECT_DOUBLE_EQ(distortion(map, 24, gradient), 5.5);
  for (const float g : gradient.values()) EXPECT_EQ(g, 2);
}

// Away from the bend, where differences see both sides.
TEST(Silhouette, FastAgreesWithReferenceAndReferenceWithCentralDifferences) {
  Random random(4);
  Tensor<double> silhouette = random_tensor<double>({6, 7}, random, 0, 1);
  Tensor<double> mask = random_tensor<double>({6, 7}, random, 0, 1);
  for (int64_t i = 0; i < mask.size(); i += 3) mask[i] = silhouette[i] + 0.07;  // in the quadratic part
  for (int64_t i = 0; i < mask.size(); ++i) {
    if (std::abs(std::abs(silhouette[i] - mask[i]) - 0.1) < 1e-3) mask[i] += 0.01;
  }
  Tensor<double> expected({6, 7}), unused({6, 7});
  const double value = loss::silhouette_reference(silhouette, mask, 0.3, expected);
  expect_close(expected,
               central_differences(
                   silhouette, [&] { return 0.3 * loss::silhouette_reference(silhouette, mask, 1, unused); }),
               1e-6, "silhouette");
  Tensor<loss::Mean> slot({1});
  Tensor<float> found({6, 7});
  loss::silhouette(convert<float>(silhouette), convert<float>(mask), 0.3, found, {slot, 0});
  EXPECT_NEAR(slot[0].value, value, 1e-6);
  expect_close(found, expected, 1e-5, "silhouette");
}

// Away from the bends of the loss, where differences see both sides.
TEST(DepthPrior, FastAgreesWithReferenceAndReferenceWithCentralDifferences) {
  Random random(5);
  Tensor<double> prior = random_tensor<double>({6, 7}, random, 0.5, 3);
  Tensor<double> depth({6, 7});
  for (int64_t i = 0; i < depth.size(); ++i)
    depth[i] = prior[i] * (i % 2 == 0 ? 1.03 : random.uniform(1.1, 2));
  for (int64_t i = 0; i < depth.size(); i += 5) depth[i] = prior[i] * 0.7;
  Tensor<double> expected({6, 7}), unused({6, 7});
  const double value = loss::depth_prior_reference(depth, prior, 0.3, expected);
  expect_close(
      expected,
      central_differences(depth, [&] { return 0.3 * loss::depth_prior_reference(depth, prior, 1, unused); }),
      1e-6, "depth prior");
  Tensor<float> found({6, 7});
  EXPECT_NEAR(depth_prior(convert<float>(depth), convert<float>(prior), 0.3, found), value, 1e-6);
  expect_close(found, expected, 1e-5, "depth prior");
}

// A scene and its prior scaled alike have the same loss.
TEST(DepthPrior, IsRelativeAndLeavesOutUnknownDepths) {
  Random random(6);
  const Tensor<float> prior = random_tensor<float>({5, 8}, random, 1, 2);
  Tensor<float> depth = random_tensor<float>({5, 8}, random, 1, 2), gradient({5, 8}), unused({5, 8});
  const double value = depth_prior(depth, prior, 1, gradient);
  EXPECT_GT(value, 0.1);
  const auto times = [](Tensor<float> values, float factor) {
    for (float& v : values.values()) v *= factor;
    return values;
  };
  EXPECT_NEAR(depth_prior(times(depth, 8), times(prior, 8), 1, unused), value, 1e-6);
  Tensor<float> nothing({5, 8});
  Tensor<float> no_prior({5, 8}), no_depth({5, 8});
  EXPECT_EQ(depth_prior(depth, nothing, 1, no_prior), 0);
  EXPECT_EQ(depth_prior(nothing, prior, 1, no_depth), 0);
  for (int64_t i = 0; i < 40; ++i) {
    EXPECT_NE(gradient[i], 0);
    EXPECT_EQ(no_prior[i], 0);
    EXPECT_EQ(no_depth[i], 0);
  }
}

TEST(RowNorm, FastAgreesWithReferenceAndReferenceWithCentralDifferences) {
  Random random(6);
  Tensor<double> rows = random_tensor<double>({9, 10}, random, -1, 1);
  for (int64_t c = 0; c < 10; ++c) rows(3, c) *= 1e-3;  // about as large as ε
  std::fill_n(rows.row(4), 10, 0.0);
  Tensor<double> expected(rows.shape()), unused(rows.shape());
  const double value = loss::row_norm_reference(rows, 0.3, expected);
  expect_close(expected,
               central_differences(
                   rows, [&] { return 0.3 * loss::row_norm_reference(rows, 1, unused); }, 1e-6),
               1e-5, "rows");
  Tensor<float> found(rows.shape());
  found.fill(1);
  EXPECT_NEAR(row_norm(convert<float>(rows), 0.3, found), value, 1e-6);
  for (float& g : found.values()) g -= 1;
  expect_close(found, expected, 1e-5, "rows");
}

// Rows of 3, 4 and of nothing: norms of 5 and 0, but for ε.
TEST(RowNorm, IsTheMeanOfLengthsAndLeavesOutWhatIsNotFinite) {
  Tensor<float> rows({3, 2}), gradient({3, 2});
  rows(0, 0) = 3;
  rows(0, 1) = 4;
  rows(2, 0) = std::numeric_limits<float>::infinity();
  EXPECT_NEAR(row_norm(rows, 1, gradient), 5.0 / 3, 1e-3);
  EXPECT_NEAR(gradient(0, 0), 0.6 / 3, 1e-6);
  EXPECT_NEAR(gradient(0, 1), 0.8 / 3, 1e-6);
  for (const int64_t i : {2, 3, 4, 5}) EXPECT_EQ(gradient[i], 0);
  Tensor<float> none({0, 2}), no_gradient({0, 2});
  EXPECT_EQ(row_norm(none, 1, no_gradient), 0);
}

TEST(SquaredError, IsTheMeanOverWhatIsKnown) {
  Tensor<float> image({1, 3, 3}), target({1, 3, 3});
  for (int64_t pixel = 0; pixel < 3; ++pixel) {
    for (int64_t channel = 0; channel < 3; ++channel) image[pixel * 3 + channel] = static_cast<float>(pixel);
  }
  image[4] = 3;
  EXPECT_DOUBLE_EQ(squared_error(image, target), (0 + 1 + 9 + 1 + 3 * 4) / 9.0);
  Tensor<uint8_t> known({1, 3});
  EXPECT_EQ(squared_error(image, target, known), 0) << "nothing is known";
  known[1] = 1;
  EXPECT_DOUBLE_EQ(squared_error(image, target, known), (1 + 9 + 1) / 3.0);
  EXPECT_THROW(squared_error(image, target, Tensor<uint8_t>({1, 2})), InternalError);
}

TEST(Losses, HostilePixelsShowInTheValueAndGiveNoGradient) {
  const Normals n(10, 10);
  const Shape shape = n.unit.shape();
  const auto unit = convert<float>(n.unit);
  for (const float bad :
       {nan_f, std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()}) {
    auto blended = convert<float>(n.blended);
    blended[3] = bad;
    Tensor<float> a(shape), b(shape), c(shape), d(shape), e(n.alpha.shape());
    EXPECT_FALSE(std::isfinite(l1(blended, unit, 1, a)));
    EXPECT_FALSE(std::isfinite(normal_consistency(blended, convert<float>(n.alpha), unit, 1, b, e, c)));
    EXPECT_FALSE(std::isfinite(normal_prior(blended, unit, 1, d)));
    EXPECT_TRUE(all_finite(a) && all_finite(b) && all_finite(c) && all_finite(d));
    EXPECT_EQ(e[1], 0);
    for (int k = 3; k < 6; ++k) EXPECT_EQ(d[k], 0);
    EXPECT_NE(d[6], 0);
  }
}

TEST(Losses, NothingWeighsNothing) {
  Tensor<float> none({0, 0, 3}), gradient({0, 0, 3}), map({0, 0});
  EXPECT_EQ(l1(none, none, 1, gradient), 0);
  EXPECT_EQ(normal_consistency(none, map, none, 1, gradient, map, gradient), 0);
  EXPECT_EQ(normal_prior(none, none, 1, gradient), 0);
  EXPECT_EQ(distortion(map, 1, map), 0);
  Tensor<float> unset({2, 2, 3});
  EXPECT_EQ(normal_prior(unset, unset, 1, unset), 0);
}

TEST(Losses, RefuseShapesThatDoNotFit) {
  Tensor<float> image({2, 2, 3}), other({2, 3, 3});
  EXPECT_THROW(l1(image, other, 1, image), InternalError);
  EXPECT_THROW(l1(image, image, 1, other), InternalError);
  Tensor<float> map({2, 2});
  EXPECT_THROW(normal_consistency(image, map, image, 1, image, map, other), InternalError);
  EXPECT_THROW(normal_consistency(image, image, image, 1, image, map, image), InternalError);
  EXPECT_THROW(normal_prior(image, other, 1, image), InternalError);
  EXPECT_THROW(normal_prior(image, image, 1, image, Tensor<float>({1, 1}), 7), InternalError);
}

TEST(Losses, SameBytesAtAnyThreadCount) {
  const Normals n(120, 110);
  const auto blended = convert<float>(n.blended), alpha = convert<float>(n.alpha),
             unit = convert<float>(n.unit);
  expect_same_bytes_at_any_thread_count([&] {
    Tensor<float> a(unit.shape()), b(unit.shape()), c(unit.shape()), d(unit.shape()), e(alpha.shape());
    Tensor<double> values({4});
    values[0] = l1(blended, unit, 1, a);
    values[1] = normal_consistency(blended, alpha, unit, 1, b, e, c);
    values[2] = normal_prior(blended, unit, 1, d);
    values[3] = distortion(blended, 1, d);
    return std::vector{convert<double>(a), convert<double>(b), convert<double>(c),
                       convert<double>(d), convert<double>(e), values};
  });
}

}  // namespace
}  // namespace traceflow::loss

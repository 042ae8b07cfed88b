#include <limits>

#include "math/ssim.h"
#include "ops/loss/loss.h"
#include "support/gradients.h"
#include "support/loss_values.h"

namespace traceflow::loss {
namespace {

using namespace traceflow::testing;

template <class T>
struct Pair {
  Tensor<T> image, target;
};

Pair<double> noise(int64_t height, int64_t width, uint64_t seed = 1) {
  Random random(seed);
  const Shape shape{height, width, 3};
  return {random_tensor<double>(shape, random, 0, 1), random_tensor<double>(shape, random, 0, 1)};
}

// Smooth shading with a little noise, as pictures have it: small variances, where rounding shows.
Pair<double> picture(int64_t height, int64_t width) {
  Random random(2);
  Pair<double> p{Tensor<double>({height, width, 3}), Tensor<double>({height, width, 3})};
  for (int64_t i = 0; i < p.image.size(); ++i) {
    const int64_t column = i / 3 % width, row = i / 3 / width;
    const auto x = static_cast<double>(column), y = static_cast<double>(row);
    p.target[i] = 0.5 + 0.4 * std::sin(x / 20) * std::cos(y / 15) + random.uniform(-0.002, 0.002);
    p.image[i] = p.target[i] + 0.05 * std::sin(x / 3) + random.uniform(-0.002, 0.002);
  }
  return p;
}

double reference(const Pair<double>& p) {
  Tensor<double> unused(p.image.shape());
  return ssim_loss_reference(p.image, p.target, 1, unused);
}

template <class T>
struct Result {
  double value;
  Tensor<T> gradient;
};

Result<float> fast_result(const Pair<double>& p, double weight = 1) {
  Result<float> r{0, Tensor<float>(p.image.shape())};
  r.value = ssim_loss(convert<float>(p.image), convert<float>(p.target), weight, r.gradient);
  return r;
}

Result<double> reference_result(const Pair<double>& p, double weight = 1) {
  Result<double> r{0, Tensor<double>(p.image.shape())};
  r.value = ssim_loss_reference(p.image, p.target, weight, r.gradient);
  return r;
}

double metric(const Pair<double>& p, const Tensor<uint8_t>& mask = {}) {
  return ssim(convert<float>(p.image), convert<float>(p.target), mask);
}

TEST(Ssim, WindowIsTheStandardsGaussian) {
  const auto window = ssim_window();
  double sum = 0;
  for (const double tap : window) sum += tap;
  EXPECT_NEAR(sum, 1, 1e-15);
  for (size_t k = 0; k < 5; ++k) EXPECT_EQ(window[k], window[10 - k]);
  EXPECT_NEAR(window[6] / window[5], std::exp(-1 / 4.5), 1e-15);
  EXPECT_NEAR(window[5], 0.26601172, 1e-8);  // as published with many implementations
}

TEST(Ssim, OfAnImageWithItselfIsOne) {
  auto p = noise(20, 30);
  p.image = p.target;
  EXPECT_NEAR(reference(p), 0, 1e-12);
  EXPECT_NEAR(fast_result(p).value, 0, 1e-6);
  EXPECT_NEAR(metric(p), 1, 1e-6);
}

// Oracle: constant images a and b, far from the border: no variance, so SSIM is (2ab + C1) / (a² + b² + C1).
TEST(Ssim, OfConstantImagesIsTheLuminanceTerm) {
  Pair<double> p{Tensor<double>({25, 25, 3}), Tensor<double>({25, 25, 3})};
  p.image.fill(0.3);
  p.target.fill(0.6);
  Tensor<uint8_t> mask({25, 25});
  mask(12, 12) = 1;
  const double expected = (2 * 0.3 * 0.6 + 1e-4) / (0.3 * 0.3 + 0.6 * 0.6 + 1e-4);
  EXPECT_NEAR(metric(p, mask), expected, 1e-4);
}

TEST(Ssim, FastAgreesWithReference) {
  // Heights under and over the window, widths with and without a rest after whole vectors.
  for (const auto& [height, width] : {std::pair{1, 1}, {3, 2}, {11, 11}, {12, 48}, {37, 53}}) {
    const auto p = noise(height, width);
    const auto fast = fast_result(p, 0.7);
    const auto plain = reference_result(p, 0.7);
    EXPECT_NEAR(fast.value, plain.value, 1e-6) << height << 'x' << width;
    expect_close(fast.gradient, plain.gradient, 1e-5, "gradient");
    EXPECT_NEAR(metric(p), 1 - plain.value, 1e-6);
  }
}

TEST(Ssim, FastAgreesWithReferenceWherePicturesAreSmooth) {
  const auto p = picture(60, 80);
  const auto fast = fast_result(p);
  const auto plain = reference_result(p);
  EXPECT_NEAR(fast.value, plain.value, 1e-5);
  expect_close(fast.gradient, plain.gradient, 1e-3, "gradient");
}

TEST(Ssim, GradientAgreesWithCentralDifferences) {
  for (const auto& [height, width] : {std::pair{7, 9}, {13, 5}}) {
    auto p = noise(height, width);
    const auto result = reference_result(p, 2);
    expect_close(result.gradient, central_differences(p.image, [&] { return 2 * reference(p); }), 1e-7,
                 "image");
  }
}

TEST(Ssim, AddsToTheGradient) {
  const auto p = noise(8, 8);
  const auto once = fast_result(p);
  Tensor<float> twice = once.gradient;
  ssim_loss(convert<float>(p.image), convert<float>(p.target), 1, twice);
  for (int64_t i = 0; i < twice.size(); ++i) EXPECT_FLOAT_EQ(twice[i], 2 * once.gradient[i]);
}

// Oracle: the mean over the whole is the mean of the means over two halves.
TEST(Ssim, MaskRestrictsTheMean) {
  const auto p = noise(16, 20);
  Tensor<uint8_t> left({16, 20}), right({16, 20});
  for (int64_t i = 0; i < 320; ++i) (i % 20 < 10 ? left : right)[i] = 255;
  EXPECT_NE(metric(p, left), metric(p, right));
  EXPECT_NEAR((metric(p, left) + metric(p, right)) / 2, metric(p), 1e-12);
  EXPECT_TRUE(std::isnan(metric(p, Tensor<uint8_t>({16, 20}))));
}

TEST(Ssim, HostilePixelsReachNoFurtherThanTheirWindows) {
  const auto clean = noise(40, 50);
  const auto expected = fast_result(clean);
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e30}) {
    auto p = clean;
    p.image(20, 25, 1) = bad;
    const auto found = fast_result(p);
    EXPECT_FALSE(std::isfinite(found.value));  // 1e30 has no square in single precision
    EXPECT_TRUE(all_finite(found.gradient));
    for (int64_t row = 0; row < 40; ++row) {
      for (int64_t column = 0; column < 50; ++column) {
        for (int64_t channel = 0; channel < 3; ++channel) {
          const bool near = std::abs(row - 20) <= 10 && std::abs(column - 25) <= 10 && channel == 1;
          if (near) continue;
          EXPECT_EQ(found.gradient(row, column, channel), expected.gradient(row, column, channel));
        }
      }
    }
  }
}

TEST(Ssim, EmptyImagesAndWrongShapes) {
  Tensor<float> none({0, 0, 3}), gradient({0, 0, 3});
  EXPECT_EQ(ssim_loss(none, none, 1, gradient), 0);
  EXPECT_TRUE(std::isnan(ssim(none, none, {})));
  Tensor<float> image({4, 4, 3}), other({4, 5, 3}), grey({4, 4});
  EXPECT_THROW(ssim_loss(image, other, 1, image), InternalError);
  EXPECT_THROW(ssim_loss(grey, grey, 1, grey), InternalError);
  EXPECT_THROW(ssim(image, image, Tensor<uint8_t>({3, 3})), InternalError);
}

TEST(Ssim, SameBytesAtAnyThreadCount) {
  const auto p = noise(70, 90);
  expect_same_bytes_at_any_thread_count([&] {
    auto result = fast_result(p);
    Tensor<float> values({2});
    values[0] = static_cast<float>(result.value);
    values[1] = static_cast<float>(metric(p));
    return std::vector{result.gradient, values};
  });
}

}  // namespace
}  // namespace traceflow::loss

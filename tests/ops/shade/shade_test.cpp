#include "ops/shade/shade.h"

#include <limits>
#include <numeric>

#include "support/gradients.h"

namespace traceflow::shade {
namespace {

using namespace traceflow::testing;

// A picture of which every other pixel was traced.
template <class T>
struct Picture {
  Tensor<T> diffuse, tint, specular;
  std::vector<int32_t> pixels;
  std::vector<float> weights;

  Picture(int64_t height, int64_t width, uint64_t seed = 1) {
    Random random(seed);
    for (int32_t i = 1; i < height * width; i += 2) pixels.push_back(i);
    for (size_t k = 0; k < pixels.size(); ++k) weights.push_back(k % 3 == 0 ? 10.0F : 1.0F);
    diffuse = random_tensor<T>({height, width, 3}, random, 0, 1);
    tint = random_tensor<T>({height, width}, random, 0, 1);
    specular = random_tensor<T>({static_cast<int64_t>(pixels.size()), 3}, random, 0, 1);
  }

  Tensor<T> colour() const {
    Tensor<T> out;
    forward(diffuse, tint, tensor_of(pixels), specular, out);
    return out;
  }

  // dL/d(diffuse, tint, specular) with tint's starting at one.
  std::vector<Tensor<T>> gradients(const Tensor<T>& grad_colour) const {
    Tensor<T> grad_diffuse, grad_specular, grad_tint(tint.shape());
    grad_tint.fill(1);
    backward(diffuse, tint, tensor_of(pixels), tensor_of(weights), specular, grad_colour, grad_diffuse,
             grad_tint, grad_specular);
    return {grad_diffuse, grad_tint, grad_specular};
  }
};

TEST(Shade, BlendsTracedPixelsAndLeavesTheOthers) {
  Tensor<float> diffuse({1, 3, 3}), tint({1, 3}), specular({1, 3}), colour;
  diffuse.fill(0.5F);
  tint.fill(0.25F);
  specular.fill(1.0F);
  const std::vector<int32_t> pixels{1};
  forward(diffuse, tint, tensor_of(pixels), specular, colour);
  for (int64_t i = 0; i < 9; ++i) EXPECT_FLOAT_EQ(colour[i], i / 3 == 1 ? 0.625F : 0.5F);
}

TEST(Shade, ColourLiesBetweenDiffuseAndSpecular) {
  const Picture<double> p(20, 30);
  const Tensor<double> colour = p.colour();
  for (size_t k = 0; k < p.pixels.size(); ++k) {
    for (int c = 0; c < 3; ++c) {
      const double d = p.diffuse[3 * p.pixels[k] + c], s = p.specular[3 * static_cast<int64_t>(k) + c];
      const double found = colour[3 * p.pixels[k] + c];
      EXPECT_GE(found, std::min(d, s) - 1e-15);
      EXPECT_LE(found, std::max(d, s) + 1e-15);
    }
  }
}

TEST(Shade, GradientAgreesWithCentralDifferences) {
  Picture<double> p(4, 5);
  p.weights.assign(p.pixels.size(), 1);
  Random random(3);
  const Tensor<double> weight = random_tensor<double>({4, 5, 3}, random, -1, 1);
  const auto value = [&] { return testing::dot(weight, p.colour()); };
  auto gradient = p.gradients(weight);
  for (double& g : gradient[1].values()) g -= 1;
  expect_close(gradient[0], central_differences(p.diffuse, value), 1e-8, "diffuse");
  expect_close(gradient[1], central_differences(p.tint, value), 1e-8, "tint");
  expect_close(gradient[2], central_differences(p.specular, value), 1e-8, "specular");
}

TEST(Shade, WeightsScaleTintAndSpecularButNotDiffuse) {
  const Picture<double> weighted(4, 5);
  Picture<double> plain = weighted;
  plain.weights.assign(plain.pixels.size(), 1);
  Tensor<double> ones({4, 5, 3});
  ones.fill(1);
  const auto a = weighted.gradients(ones), b = plain.gradients(ones);
  for (int64_t i = 0; i < a[0].size(); ++i) EXPECT_EQ(a[0][i], b[0][i]);
  for (size_t k = 0; k < plain.pixels.size(); ++k) {
    const int64_t pixel = plain.pixels[k];
    EXPECT_NEAR(a[1][pixel] - 1, weighted.weights[k] * (b[1][pixel] - 1), 1e-12);
    EXPECT_NEAR(a[2][3 * static_cast<int64_t>(k)], weighted.weights[k] * b[2][3 * static_cast<int64_t>(k)],
                1e-12);
  }
}

TEST(Shade, FloatAgreesWithDouble) {
  const Picture<double> plain(30, 40);
  Picture<float> fast(30, 40);
  fast.diffuse = convert<float>(plain.diffuse);
  fast.tint = convert<float>(plain.tint);
  fast.specular = convert<float>(plain.specular);
  expect_close(fast.colour(), plain.colour(), 1e-6, "colour");
  Random random(4);
  const Tensor<double> weight = random_tensor<double>({30, 40, 3}, random, -1, 1);
  const auto a = fast.gradients(convert<float>(weight));
  const auto b = plain.gradients(weight);
  for (size_t i = 0; i < 3; ++i) expect_close(a[i], b[i], 1e-6, "gradient");
}

TEST(Shade, HostilePixelsStayAlone) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const Picture<float> clean(4, 5);
  Picture<float> bad = clean;
  bad.tint[3] = nan;
  bad.specular[3 * 3] = nan;  // of pixel 7
  bad.diffuse[0] = std::numeric_limits<float>::infinity();
  const Tensor<float> a = bad.colour(), b = clean.colour();
  Tensor<float> ones({4, 5, 3});
  ones.fill(1);
  const auto grad_a = bad.gradients(ones), grad_b = clean.gradients(ones);
  for (int64_t pixel = 0; pixel < 20; ++pixel) {
    if (pixel == 0 || pixel == 3 || pixel == 7) continue;
    for (int c = 0; c < 3; ++c) EXPECT_EQ(a[3 * pixel + c], b[3 * pixel + c]);
    EXPECT_EQ(grad_a[0][3 * pixel], grad_b[0][3 * pixel]);
    EXPECT_EQ(grad_a[1][pixel], grad_b[1][pixel]);
  }
}

TEST(Shade, NothingTracedAndNothingAtAll) {
  Picture<float> p(4, 5);
  p.pixels.clear();
  p.weights.clear();
  p.specular.resize({0, 3});
  const Tensor<float> colour = p.colour();
  EXPECT_TRUE(std::equal(colour.data(), colour.data() + colour.size(), p.diffuse.data()));
  EXPECT_TRUE(Picture<float>(0, 0).colour().empty());
}

TEST(Shade, RefusesWhatDoesNotFit) {
  Picture<float> p(4, 5);
  p.pixels.back() = 20;
  EXPECT_THROW(p.colour(), InternalError);
  p = Picture<float>(4, 5);
  p.specular.resize({1, 3});
  EXPECT_THROW(p.colour(), InternalError);
  p = Picture<float>(4, 5);
  p.weights.pop_back();
  EXPECT_THROW(p.gradients(p.diffuse), InternalError);
}

TEST(Shade, SameBytesAtAnyThreadCount) {
  const Picture<float> p(150, 140);
  expect_same_bytes_at_any_thread_count([&] {
    auto all = p.gradients(p.diffuse);
    all.push_back(p.colour());
    return all;
  });
}

}  // namespace
}  // namespace traceflow::shade

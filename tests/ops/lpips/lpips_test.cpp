#include "ops/lpips/lpips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>

#include "support/narrow_lpips.h"
#include "support/refusal.h"

namespace traceflow::lpips {
namespace {

using ::testing::HasSubstr;
using traceflow::testing::all_finite;
using traceflow::testing::central_differences;
using traceflow::testing::expect_close;
using traceflow::testing::expect_same_bytes_at_any_thread_count;
using traceflow::testing::lpips_distance;
using traceflow::testing::lpips_file;
using traceflow::testing::narrow_lpips_weights;

Tensor<float> random_tensor(const Shape& shape, Random& random, double low, double high) {
  return traceflow::testing::random_tensor<float>(shape, random, low, high);
}

BasicWeights<double> in_double(const Weights& weights) {
  BasicWeights<double> result;
  for (const auto& c : weights.convolutions) {
    result.convolutions.push_back({convert<double>(c.weight), convert<double>(c.bias)});
  }
  for (const auto& l : weights.linear) result.linear.push_back(convert<double>(l));
  return result;
}

TEST(Lpips, FastPathMatchesTheReference) {
  Random random(3);
  for (const auto& [h, w] : {std::pair<int64_t, int64_t>{16, 16}, {33, 47}, {40, 22}}) {
    const Weights weights = narrow_lpips_weights(static_cast<uint64_t>(h));
    const Tensor<float> a = random_tensor({h, w, 3}, random, 0, 1);
    const Tensor<float> b = random_tensor({h, w, 3}, random, 0, 1);
    for (const Input input : {Input::defined, Input::published}) {
      const double truth =
          distance_reference(in_double(weights), convert<double>(a), convert<double>(b), input);
      EXPECT_GT(truth, 1e-3);
      EXPECT_NEAR(distance(network_of(weights), a, b, input), truth, 1e-5 * truth) << h << "x" << w;
    }
  }
}

// Every convolution the identity, every linear weight one: the distance can be said in closed form. Two
// constant images whose scaled colours are (p, p, p) and (p, 0, 0) have unit features (1, 1, 1)/√3 and (1, 0,
// 0) in every stage, whose squared distance is 2 − 2/√3.
TEST(Lpips, ReferenceGivesTheClosedFormOfAnIdentityNetwork) {
  BasicWeights<double> weights;
  for (int i = 0; i < 13; ++i) {
    Tensor<double> weight(Shape{3, 3, 3, 3});
    for (int64_t c = 0; c < 3; ++c) weight[(c * 3 + c) * 9 + 4] = 1;
    weights.convolutions.push_back({weight, Tensor<double>(Shape{3})});
  }
  for (int i = 0; i < stages; ++i) {
    weights.linear.emplace_back(Shape{3});
    weights.linear.back().fill(1);
  }
  // Inverse of LPIPS's scaling for [0, 1] input: value = p·scale + shift.
  const double shift[] = {-.030, -.088, -.188}, scale[] = {.458, .448, .450};
  Tensor<double> a(Shape{17, 19, 3}), b(Shape{17, 19, 3});
  for (int64_t i = 0; i < a.size(); ++i) {
    const int64_t c = i % 3;
    a[i] = shift[c] + 0.7 * scale[c];
    b[i] = shift[c] + (c == 0 ? 0.7 * scale[c] : 0);
  }
  const double per_stage = 2 - 2 / std::sqrt(3.0);
  EXPECT_NEAR(distance_reference(weights, a, b, Input::published), stages * per_stage, 1e-9);
  // As defined, the network is fed 2v − 1.
  for (double& v : a.values()) v = (v + 1) / 2;
  for (double& v : b.values()) v = (v + 1) / 2;
  EXPECT_NEAR(distance_reference(weights, a, b, Input::defined), stages * per_stage, 1e-9);
}

TEST(Lpips, ADistanceIsZeroBetweenEqualsAndSymmetric) {
  Random random(5);
  const Weights weights = narrow_lpips_weights(1);
  const Tensor<float> a = random_tensor({20, 24, 3}, random, 0, 1);
  const Tensor<float> b = random_tensor({20, 24, 3}, random, 0, 1);
  EXPECT_EQ(distance(network_of(weights), a, a, Input::defined), 0);
  EXPECT_EQ(distance(network_of(weights), a, b, Input::defined),
            distance(network_of(weights), b, a, Input::defined));
}

struct Images {
  Images(int64_t h, int64_t w, uint64_t seed) {
    Random random(seed);
    a = random_tensor({h, w, 3}, random, 0, 1);
    b = random_tensor({h, w, 3}, random, 0, 1);
  }
  Tensor<float> a, b;
};

// The steps are short: a longer one would now and then cross the corner of a gate or of a halving.
TEST(Lpips, ReferenceGradientAgreesWithCentralDifferences) {
  const Images images(16, 18, 7);
  const BasicWeights<double> weights = in_double(narrow_lpips_weights(9));
  Tensor<double> a = convert<double>(images.a);
  const Tensor<double> b = convert<double>(images.b);
  for (const Input input : {Input::defined, Input::published}) {
    Tensor<double> gradient(a.shape());
    const double value = distance_reference(weights, a, b, input, 2, gradient);
    EXPECT_EQ(value, distance_reference(weights, a, b, input));
    const auto differences = central_differences(
        a, [&] { return 2 * distance_reference(weights, a, b, input); }, 1e-7);
    expect_close(gradient, differences, 1e-5, "image");
  }
}

TEST(Lpips, FastGradientMatchesTheReference) {
  for (const auto& [h, w] : {std::pair<int64_t, int64_t>{16, 16}, {33, 47}, {40, 22}}) {
    const Images images(h, w, 4);
    const Weights weights = narrow_lpips_weights(static_cast<uint64_t>(w));
    for (const Input input : {Input::defined, Input::published}) {
      Tensor<float> fast(images.a.shape());
      Tensor<double> plain(images.a.shape());
      const double value = lpips_distance(network_of(weights), images.a, images.b, input, 0.7, fast);
      distance_reference(in_double(weights), convert<double>(images.a), convert<double>(images.b), input, 0.7,
                         plain);
      EXPECT_EQ(value, distance(network_of(weights), images.a, images.b, input));
      expect_close(fast, plain, 1e-4, "image");
    }
  }
}

TEST(Lpips, AddsToTheGradient) {
  const Images images(20, 17, 11);
  const Network network = network_of(narrow_lpips_weights(5));
  Tensor<float> once(images.a.shape());
  lpips_distance(network, images.a, images.b, Input::defined, 1, once);
  Tensor<float> twice = once;
  lpips_distance(network, images.a, images.b, Input::defined, 1, twice);
  for (int64_t i = 0; i < twice.size(); ++i) EXPECT_FLOAT_EQ(twice[i], 2 * once[i]);
}

// Oracle: no image is nearer to the target than the target.
TEST(Lpips, TheGradientOfEqualImagesIsZero) {
  const Images images(16, 16, 12);
  Tensor<float> gradient(images.a.shape());
  EXPECT_EQ(
      lpips_distance(network_of(narrow_lpips_weights(5)), images.a, images.a, Input::defined, 1, gradient),
      0);
  for (const float v : gradient.values()) EXPECT_EQ(v, 0);
}

TEST(Lpips, SameBytesAtAnyThreadCount) {
  const Images images(50, 61, 6);
  const Network network = network_of(narrow_lpips_weights(2));
  expect_same_bytes_at_any_thread_count([&] {
    Tensor<double> value(Shape{1});
    Tensor<float> gradient(images.a.shape());
    value[0] = lpips_distance(network, images.a, images.b, Input::defined, 1, gradient);
    return std::vector{value, convert<double>(gradient)};
  });
}

TEST(Lpips, HostilePixelsShowInTheValueAndGetNoGradient) {
  const Network network = network_of(narrow_lpips_weights(3));
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (const bool in_target : {false, true}) {
      Images images(18, 20, 2);
      (in_target ? images.b : images.a)(9, 3, 1) = bad;
      Tensor<float> gradient(images.a.shape());
      gradient.fill(0.5F);
      EXPECT_TRUE(std::isnan(lpips_distance(network, images.a, images.b, Input::defined, 1, gradient)));
      for (const float v : gradient.values()) EXPECT_EQ(v, 0.5F);
    }
  }
  for (const float large : {1e20F, -1e38F, std::numeric_limits<float>::denorm_min()}) {
    Images images(18, 20, 2);
    images.a(9, 3, 1) = large;
    Tensor<float> gradient(images.a.shape());
    lpips_distance(network, images.a, images.b, Input::defined, 1, gradient);
    EXPECT_TRUE(all_finite(gradient)) << large;
  }
}

// A network that is dead from its first layer on has features of no length, and so no direction to compare.
TEST(Lpips, FeaturesOfNoLengthAreEqualAndHaveNoGradient) {
  const Images images(16, 16, 2);
  Weights weights = narrow_lpips_weights(3);
  for (auto& convolution : weights.convolutions) {
    convolution.weight.zero();
    convolution.bias.zero();
  }
  Tensor<float> gradient(images.a.shape());
  EXPECT_EQ(lpips_distance(network_of(weights), images.a, images.b, Input::defined, 1, gradient), 0);
  for (const float v : gradient.values()) EXPECT_EQ(v, 0);
}

TEST(Lpips, ImagesThatDoNotFitAreRefused) {
  const Network network = network_of(narrow_lpips_weights(3));
  const Tensor<float> image({16, 16, 3}), other({16, 17, 3}), narrow({16, 15, 3}), grey({16, 16});
  Tensor<float> gradient({16, 17, 3});
  EXPECT_THROW(distance(network, image, other, Input::defined), InternalError);
  EXPECT_THROW(distance(network, narrow, narrow, Input::defined), InternalError);
  EXPECT_THROW(distance(network, grey, grey, Input::defined), InternalError);
  EXPECT_THROW(distance(network, {}, {}, Input::defined), InternalError);
  EXPECT_THROW(lpips_distance(network, image, image, Input::defined, 1, gradient), InternalError);
}

class LpipsWeights : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(file_); }
  std::string refusal() const {
    return refusal_of([&] { read_weights(file_); });
  }
  std::filesystem::path file_ = std::filesystem::temp_directory_path() /
                                ("traceflow-lpips-" + std::to_string(::getpid()) + ".safetensors");
};

TEST_F(LpipsWeights, AreReadUnderTheExportersNames) {
  Random random(8);
  const Weights weights = narrow_lpips_weights(4);
  lpips_file(weights).write(file_);
  const Weights back = read_weights(file_);
  const Tensor<float> a = random_tensor({16, 18, 3}, random, 0, 1);
  const Tensor<float> b = random_tensor({16, 18, 3}, random, 0, 1);
  EXPECT_EQ(distance(network_of(back), a, b, Input::defined),
            distance(network_of(weights), a, b, Input::defined));
}

TEST_F(LpipsWeights, OfAnotherShapeAreRefused) {
  Weights weights = narrow_lpips_weights(4);
  weights.convolutions[3].weight = Tensor<float>(Shape{6, 5, 3, 3});
  lpips_file(weights).write(file_);
  EXPECT_THAT(refusal(), HasSubstr("features.7.weight"));

  weights = narrow_lpips_weights(4);
  weights.linear[2] = Tensor<float>(Shape{9});
  lpips_file(weights).write(file_);
  EXPECT_THAT(refusal(), HasSubstr("lin2.model.1.weight"));

  weights = narrow_lpips_weights(4);
  weights.convolutions[0].bias = Tensor<float>(Shape{3});
  lpips_file(weights).write(file_);
  EXPECT_THAT(refusal(), HasSubstr("features.0.bias"));

  weights = narrow_lpips_weights(4);
  weights.convolutions[12].weight[5] = std::numeric_limits<float>::quiet_NaN();
  lpips_file(weights).write(file_);
  EXPECT_THAT(refusal(), HasSubstr("features.28.weight"));

  weights = narrow_lpips_weights(4);
  weights.linear.pop_back();
  lpips_file(weights).write(file_);
  EXPECT_THAT(refusal(), HasSubstr("lin4.model.1.weight"));
}

}  // namespace
}  // namespace traceflow::lpips

#include <cmath>
#include <cstring>
#include <limits>

#include "ops/lpips/cuda/distance.h"
#include "primitives/gemm.h"
#include "support/device.h"
#include "support/narrow_lpips.h"

namespace traceflow::lpips {
namespace {

using namespace traceflow::testing;

struct Images {
  Images(int64_t h, int64_t w, uint64_t seed) {
    Random random(seed);
    a = random_tensor<float>({h, w, 3}, random, 0, 1);
    b = random_tensor<float>({h, w, 3}, random, 0, 1);
  }
  Tensor<float> a, b;
};

struct Outcome {
  double value, value_alone;
  Tensor<float> gradient;  // on the device
};

// The gradient is added to what `before` says.
Outcome run(Device device, const Weights& weights, const Images& images, Input input, float before = 0) {
  const Network network = network_of(weights).on(device);
  const Tensor<float> a = images.a.on(device), b = images.b.on(device);
  Tensor<float> gradient(images.a.shape());
  gradient.fill(before);
  Outcome o{0, 0, gradient.on(device)};
  o.value = lpips_distance(network, a, b, input, 0.7, o.gradient);
  o.value_alone = distance(network, a, b, input);
  EXPECT_EQ(o.gradient.device(), device);
  return o;
}

void expect_all(const Tensor<float>& found, float value) {
  const Tensor<float> here = found.on(Device::cpu);
  for (const float v : here.values()) EXPECT_EQ(v, value);
}

class LpipsOnDevice : public OnDevice {
 protected:
  void TearDown() override {
    if (!IsSkipped()) cuda::allow_epilogues(true);
    device::patch_bytes = kept_patch_bytes_;
  }

 private:
  const int64_t kept_patch_bytes_ = device::patch_bytes;
};

// Sums of up to some seventy products in another order, through thirteen layers: some roundings of the
// largest. No gate and no halving of these images is near enough to its corner to turn.
void expect_agrees(const Weights& weights, const Images& images, Input input, float before = 0) {
  const Outcome expected = run(Device::cpu, weights, images, input, before),
                found = run(Device::cuda, weights, images, input, before);
  EXPECT_GT(expected.value, 1e-3);
  EXPECT_NEAR(found.value, expected.value, 1e-5 * expected.value);
  EXPECT_EQ(found.value, found.value_alone);
  expect_close_on_host(found.gradient, expected.gradient, 1e-4, "gradient");
}

TEST_F(LpipsOnDevice, AgreesWithTheCpu) {
  for (const auto& [h, w] : {std::pair<int64_t, int64_t>{16, 16}, {33, 47}, {40, 22}}) {
    for (const Input input : {Input::defined, Input::published}) {
      expect_agrees(narrow_lpips_weights(static_cast<uint64_t>(w)), Images(h, w, 4), input);
    }
  }
}

// Blocks begin and end in the midst of rows and of images; bias and ReLU are a step of their own.
TEST_F(LpipsOnDevice, BlocksAndStandInsChangeNothing) {
  device::patch_bytes = 1;
  expect_agrees(narrow_lpips_weights(6), Images(33, 47, 5), Input::defined);
  cuda::allow_epilogues(false);
  expect_agrees(narrow_lpips_weights(6), Images(21, 35, 5), Input::defined);
}

TEST_F(LpipsOnDevice, AddsToTheGradient) {
  expect_agrees(narrow_lpips_weights(5), Images(20, 17, 11), Input::defined, 0.25F);
}

TEST_F(LpipsOnDevice, SameBytesEveryTime) {
  const Images images(26, 31, 6);
  const Weights weights = narrow_lpips_weights(2);
  const Outcome first = run(Device::cuda, weights, images, Input::defined),
                second = run(Device::cuda, weights, images, Input::defined);
  EXPECT_EQ(first.value, second.value);
  const Tensor<float> a = first.gradient.on(Device::cpu), b = second.gradient.on(Device::cpu);
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.values().size_bytes()), 0);
}

// What is kept from a larger call must not show in a smaller one.
TEST_F(LpipsOnDevice, CallsOfOtherSizesLeaveNothingBehind) {
  const Weights weights = narrow_lpips_weights(7);
  const Images small(17, 16, 8), large(35, 30, 9);
  const Outcome before = run(Device::cuda, weights, small, Input::defined);
  run(Device::cuda, weights, large, Input::defined);
  const Outcome after = run(Device::cuda, weights, small, Input::defined);
  EXPECT_EQ(before.value, after.value);
  expect_close_on_host(after.gradient, before.gradient.on(Device::cpu), 0, "gradient");
}

TEST_F(LpipsOnDevice, EqualImagesHaveNoDistanceAndNoGradient) {
  Images images(16, 19, 12);
  images.b = images.a;
  for (const int64_t bytes : {device::patch_bytes, int64_t{1}}) {
    device::patch_bytes = bytes;
    const Outcome o = run(Device::cuda, narrow_lpips_weights(5), images, Input::defined);
    // A fused multiply-add leaves what the direction that it is not fused with was rounded by: 1e-16.
    EXPECT_LE(o.value, 1e-30);
    const Tensor<float> gradient = o.gradient.on(Device::cpu);
    for (const float g : gradient.values()) EXPECT_LE(std::abs(g), 1e-15F);
  }
}

// Constant images tie in every halving: the first of four has the gradient.
TEST_F(LpipsOnDevice, TiesGoToTheFirstAsOnTheCpu) {
  Images images(32, 34, 12);
  images.a.fill(0.3F);
  images.b.fill(0.6F);
  expect_agrees(narrow_lpips_weights(4), images, Input::defined);
}

// A network that is dead from its first layer on has features of no length.
TEST_F(LpipsOnDevice, FeaturesOfNoLengthAreEqualAndHaveNoGradient) {
  Weights weights = narrow_lpips_weights(3);
  for (auto& convolution : weights.convolutions) {
    convolution.weight.zero();
    convolution.bias.zero();
  }
  const Outcome o = run(Device::cuda, weights, Images(16, 16, 2), Input::defined);
  EXPECT_EQ(o.value, 0);
  expect_all(o.gradient, 0);
}

TEST_F(LpipsOnDevice, HostilePixelsShowInTheValueAndGetNoGradient) {
  const Weights weights = narrow_lpips_weights(3);
  constexpr float infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity}) {
    for (const bool in_target : {false, true}) {
      Images images(18, 20, 2);
      (in_target ? images.b : images.a)(9, 3, 1) = bad;
      const Outcome o = run(Device::cuda, weights, images, Input::defined, 0.5F);
      EXPECT_TRUE(std::isnan(o.value) && std::isnan(o.value_alone));
      expect_all(o.gradient, 0.5F);
    }
  }
  for (const float large : {1e20F, -1e38F, std::numeric_limits<float>::denorm_min()}) {
    Images images(18, 20, 2);
    images.a(9, 3, 1) = large;
    EXPECT_TRUE(all_finite(run(Device::cuda, weights, images, Input::defined).gradient.on(Device::cpu)));
  }
}

// The distance is finite, its gradient is not: only the gradient tells.
TEST_F(LpipsOnDevice, AGradientThatIsNotFiniteIsLeftOut) {
  const Images images(18, 20, 2);
  for (const Device device : {Device::cpu, Device::cuda}) {
    const Network network = network_of(narrow_lpips_weights(3)).on(device);
    Tensor<float> gradient(images.a.shape(), device);
    const double value =
        lpips_distance(network, images.a.on(device), images.b.on(device), Input::defined, 1e300, gradient);
    EXPECT_TRUE(std::isfinite(value));
    expect_all(gradient, 0);
  }
}

TEST_F(LpipsOnDevice, ImagesAndNetworkOnTwoDevicesAreRefused) {
  const Images images(16, 16, 1);
  const Network network = network_of(narrow_lpips_weights(3));
  const Tensor<float> a = images.a.on(Device::cuda), b = images.b.on(Device::cuda);
  EXPECT_THROW(distance(network, a, b, Input::defined), InternalError);
  EXPECT_THROW(distance(network.on(Device::cuda), a, images.b, Input::defined), InternalError);
  Tensor<float> gradient(images.a.shape());
  EXPECT_THROW(lpips_distance(network.on(Device::cuda), a, b, Input::defined, 1, gradient), InternalError);
}

}  // namespace
}  // namespace traceflow::lpips

#include <limits>

#include "support/device.h"
#include "support/narrow_lpips.h"
#include "train/objective.h"
#include "train/optimiser.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using TrainOnDevice = OnDevice;

struct Outcome {
  LossValues terms;
  FrameGradient gradient;
};

Outcome evaluate(Device device, NormalLosses normals) {
  Random random(1);
  const Shape shape{20, 24, 3};
  Frame frame;
  ViewImages target;
  const auto noise = [&](double low) { return random_tensor<float>(shape, random, low, 1).on(device); };
  frame.colour = noise(0);
  frame.raster.normal = noise(-1);
  frame.pseudo_normal = noise(-1);
  frame.raster.tint = random_tensor<float>({20, 24}, random, 0, 1).on(device);
  frame.raster.alpha = random_tensor<float>({20, 24}, random, 0, 1).on(device);
  frame.raster.distortion = random_tensor<float>({20, 24}, random, 0, 1).on(device);
  target.colour = noise(0);
  target.normal_prior = noise(-1);
  LossOptions options;
  options.distortion = 3;
  options.normal_prior_on_mirrors = 7;
  options.lpips = 0.7F;
  const lpips::Network perceptual = lpips::network_of(narrow_lpips_weights(2)).on(device);
  Outcome o;
  LossMeans means;
  Tensor<float> rest;
  evaluate_objective({frame, target, options, normals, &perceptual}, {o.gradient, rest}, means);
  o.terms = means.read();
  return o;
}

TEST_F(TrainOnDevice, TheObjectiveAgreesWithTheCpu) {
  for (const NormalLosses normals : {NormalLosses::none, NormalLosses::even, NormalLosses::more_on_mirrors}) {
    const Outcome expected = evaluate(Device::cpu, normals), found = evaluate(Device::cuda, normals);
    EXPECT_NEAR(found.terms.total, expected.terms.total, 1e-5);
    ASSERT_EQ(found.terms.terms.size(), expected.terms.terms.size());
    for (const LossValue& term : expected.terms.terms)
      EXPECT_NEAR(found.terms[term.name], term.value, 1e-5) << term.name;
    EXPECT_NEAR(found.terms.psnr.value(), expected.terms.psnr.value(), 1e-5);
    expect_close_on_host(found.gradient.colour, expected.gradient.colour, 1e-5, "colour");
    expect_close_on_host(found.gradient.distortion, expected.gradient.distortion, 1e-6, "distortion");
    EXPECT_EQ(found.gradient.normal.empty(), normals == NormalLosses::none);
    if (normals == NormalLosses::none) continue;
    expect_close_on_host(found.gradient.normal, expected.gradient.normal, 1e-5, "normal");
    expect_close_on_host(found.gradient.alpha, expected.gradient.alpha, 1e-6, "alpha");
    expect_close_on_host(found.gradient.pseudo_normal, expected.gradient.pseudo_normal, 1e-5, "pseudo");
  }
}

Surfels noisy_surfels(int64_t count, Random& random) {
  Surfels s;
  s.position = random_tensor<float>({count, 3}, random, -1, 1);
  s.log_scale = random_tensor<float>({count, 2}, random, -1, 1);
  s.rotation = random_tensor<float>({count, 4}, random, -1, 1);
  s.opacity_logit = random_tensor<float>({count}, random, -1, 1);
  s.sh = random_tensor<float>({count, 4, 3}, random, -1, 1);
  s.tint_logit = random_tensor<float>({count}, random, -1, 1);
  return s;
}

struct Stepped {
  Scene scene;
  NonFiniteGradients non_finite;
};

Stepped step(Device device) {
  Random random(2);
  Stepped result;
  SceneGradient gradient;
  result.scene.main = noisy_surfels(50, random);
  gradient.main = noisy_surfels(50, random);
  gradient.main.rotation(17, 2) = std::numeric_limits<float>::quiet_NaN();
  gradient.main.rotation(40, 0) = 1e30F;
  gradient.main.sh(3, 1, 1) = std::numeric_limits<float>::infinity();
  const auto move = [&](const std::string&, Tensor<float>& t) { t = t.on(device); };
  result.scene.main.for_each(move);
  gradient.main.for_each(move);
  const TrainOptions options;
  Optimiser optimiser(result.scene);
  Trainable trainable;
  trainable.environment = false;
  optimiser.prepare(result.scene, gradient, trainable, Schedule(options), options.rates, 0);
  optimiser.step();
  result.non_finite = optimiser.non_finite();
  return result;
}

TEST_F(TrainOnDevice, TheOptimiserAgreesWithTheCpuAndNamesTheFirstBadGradient) {
  const Stepped expected = step(Device::cpu), found = step(Device::cuda);
  EXPECT_EQ(expected.non_finite.count, 3);
  EXPECT_EQ(expected.non_finite.first, "main.rotation, row 17");
  EXPECT_EQ(found.non_finite.count, 3);
  EXPECT_EQ(found.non_finite.first, expected.non_finite.first);
  std::vector<const Tensor<float>*> tensors;
  expected.scene.main.for_each([&](const std::string&, const Tensor<float>& t) { tensors.push_back(&t); });
  size_t k = 0;
  found.scene.main.for_each([&](const std::string& name, const Tensor<float>& t) {
    expect_close_on_host(t, *tensors[k++], 1e-6, name.c_str());
  });
}

}  // namespace
}  // namespace traceflow

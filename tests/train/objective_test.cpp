#include "train/objective.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "capture/pixels.h"
#include "support/gradients.h"
#include "support/narrow_lpips.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using testing::narrow_lpips_weights;
using testing::random_tensor;

struct Fixture {
  Fixture() {
    Random random(1);
    const Shape shape{20, 24, 3};
    frame.colour = random_tensor<float>(shape, random, 0, 1);
    frame.raster.normal = random_tensor<float>(shape, random, -1, 1);
    frame.pseudo_normal = random_tensor<float>(shape, random, -1, 1);
    frame.raster.tint = random_tensor<float>({20, 24}, random, 0, 1);
    frame.raster.distortion = random_tensor<float>({20, 24}, random, 0, 1);
    frame.raster.alpha = random_tensor<float>({20, 24}, random, 0, 1);
    target.colour = random_tensor<float>(shape, random, 0, 1);
    target.normal_prior = random_tensor<float>(shape, random, -1, 1);
    options.distortion = 3;
    options.lpips = 0.7F;
  }
  Frame frame;
  ViewImages target;
  LossOptions options;
  lpips::Network network = lpips::network_of(narrow_lpips_weights(2));
};

LossValues evaluate(const Fixture& f, FrameGradient& gradient, const lpips::Network* network = nullptr,
                    NormalLosses normals = NormalLosses::more_on_mirrors) {
  LossMeans means;
  Tensor<float> rest;
  evaluate_objective({f.frame, f.target, f.options, normals, network}, {gradient, rest}, means);
  return means.read();
}

TEST(Objective, TheTotalIsTheWeightedSumOfItsTerms) {
  const Fixture f;
  FrameGradient gradient;
  const LossValues t = evaluate(f, gradient, &f.network);
  for (const double term : {t["l1"], t["ssim"], t["normal"], t["normal_prior"], t["distortion"], t["lpips"]})
    EXPECT_NE(term, 0);
  const LossOptions& o = f.options;
  EXPECT_NEAR(t.total,
              (1 - o.ssim) * t["l1"] + o.ssim * t["ssim"] + o.normal * t["normal"] +
                  o.normal_prior * t["normal_prior"] + o.distortion * t["distortion"] + o.lpips * t["lpips"],
              1e-12);
}

TEST(Objective, DepthPriorsCountByTheirShare) {
  Fixture f;
  Random random(8);
  f.frame.raster.depth = random_tensor<float>({20, 24}, random, 1, 2);
  f.options.depth_prior = 0.5F;
  LossMeans means;
  FrameGradient gradient;
  Tensor<float> rest;
  LossInputs inputs{f.frame, f.target, f.options};
  const auto evaluated = [&](double share) {
    inputs.depth_prior_share = share;
    evaluate_objective(inputs, {gradient, rest}, means);
    return means.read();
  };
  const double without = evaluated(1).total;
  EXPECT_TRUE(gradient.depth.empty()) << "the capture has none";
  f.target.depth_prior = random_tensor<float>({20, 24}, random, 1, 2);
  EXPECT_EQ(evaluated(0).total, without);
  const LossValues half = evaluated(0.5), whole = evaluated(1);
  EXPECT_GT(whole["depth_prior"], 0.1);
  EXPECT_NEAR(whole.total - without, 0.5 * whole["depth_prior"], 1e-9);
  EXPECT_NEAR(half.total - without, 0.25 * whole["depth_prior"], 1e-9);
  EXPECT_EQ(gradient.depth.shape(), f.frame.raster.depth.shape());
}

TEST(Objective, NormalPriorsCountMoreOnMirrors) {
  Fixture f;
  FrameGradient on_mirrors, even, none;
  f.options.normal = 0;
  f.options.normal_prior_on_mirrors = 7;
  EXPECT_GT(evaluate(f, on_mirrors)["normal_prior"],
            evaluate(f, even, nullptr, NormalLosses::even)["normal_prior"]);
  for (int64_t i = 0; i < f.frame.raster.tint.size(); ++i) {
    const double more = 1 + 6 * f.frame.raster.tint[i];
    for (int64_t c = 3 * i; c < 3 * i + 3; ++c)
      EXPECT_NEAR(on_mirrors.normal[c], more * even.normal[c], 1e-6);
  }
  EXPECT_EQ(evaluate(f, none, nullptr, NormalLosses::none)["normal_prior"], 0);
  EXPECT_TRUE(none.normal.empty());
}

// What is not known has the render's colours, which are no error and no measure.
TEST(Objective, PsnrIsOfWhatIsKnown) {
  Fixture f;
  FrameGradient gradient;
  const double all = evaluate(f, gradient).psnr.value();
  f.target.known.resize({20, 24});
  f.target.known.fill(1);
  EXPECT_NEAR(evaluate(f, gradient).psnr.value(), all, 1e-9);
  for (int64_t y = 0; y < 20; ++y) {
    for (int64_t x = 0; x < 18; ++x) f.target.known(y, x) = 0;
  }
  take_unknown(f.frame.colour, f.target);
  EXPECT_NEAR(evaluate(f, gradient).psnr.value(), all, 1)
      << "not the 6 dB that three quarters of no error give";
  f.target.known.fill(0);
  EXPECT_FALSE(evaluate(f, gradient).psnr.has_value());
}

TEST(Objective, WithoutItsNetworkTheImageHasNoPerceptualTerm) {
  const Fixture f;
  FrameGradient with, without;
  const LossValues a = evaluate(f, with, &f.network);
  const LossValues b = evaluate(f, without);
  EXPECT_EQ(b["lpips"], 0);
  EXPECT_NEAR(a.total - b.total, f.options.lpips * a["lpips"], 1e-12);
  // What the network adds to the gradient is the weighted gradient of its distance.
  Tensor<float> expected = without.colour;
  testing::lpips_distance(f.network, f.frame.colour, f.target.colour, lpips::Input::defined, f.options.lpips,
                          expected);
  EXPECT_NE(std::memcmp(with.colour.data(), without.colour.data(), with.colour.values().size_bytes()), 0);
  EXPECT_EQ(std::memcmp(with.colour.data(), expected.data(), with.colour.values().size_bytes()), 0);
}

std::string refusal(const LossOptions& options, const Capture& capture) {
  return refusal_of([&] { perceptual_network(options, capture); });
}

TEST(PerceptualNetwork, IsReadWhereItHasAWeightAndRefusedByName) {
  const TempFolder folder;
  testing::lpips_file(narrow_lpips_weights(2)).write(folder / "weights.safetensors");
  std::ofstream(folder / "text.safetensors") << "not a file of weights";
  Capture capture;
  capture.train.resize(1);
  capture.train[0].camera.width = 16;
  capture.train[0].camera.height = 40;

  LossOptions options;
  EXPECT_FALSE(perceptual_network(options, capture).has_value());
  options.lpips = 0.1F;
  options.lpips_weights = (folder / "weights.safetensors").string();
  EXPECT_TRUE(perceptual_network(options, capture).has_value());
  for (const char* name : {"text.safetensors", "nothing.safetensors"}) {
    options.lpips_weights = (folder / name).string();
    EXPECT_THAT(refusal(options, capture), ::testing::HasSubstr(name));
  }
  options.lpips_weights = (folder / "weights.safetensors").string();
  capture.train[0].camera.width = 15;
  EXPECT_THAT(refusal(options, capture), ::testing::HasSubstr("15x40"));
}

TEST(PerceptualNetwork, AWeightWithoutAFileIsRefused) {
  LossOptions options;
  options.lpips = 0.1F;
  try {
    options.validate();
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("loss.lpips_weights"));
  }
}

}  // namespace
}  // namespace traceflow

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ostream>
#include <string>

#include "base/parallel.h"
#include "raster_scenes.h"

// The fast path against the reference. Single precision decides differently at a discontinuity (α at its
// limit, two centres at one depth, the last hit of a pixel), so that a small share of the pixels may differ;
// all others agree closely.
namespace traceflow::raster {
namespace {

struct Case {
  const char* name;
  int width, height;
  Options options;
  SceneOptions scene;
  double differing_share = 0.002;
  double gradient_tolerance = 1e-4;
  double gradient_share = 0.005;

  friend std::ostream& operator<<(std::ostream& to, const Case& c) { return to << c.name; }
};

std::vector<Case> cases() {
  Options centre;
  centre.background = {0.3F, 0.6F, 0.1F};
  Options hit = centre;
  hit.sort = SortOrder::hit;
  Options sharp = centre;
  sharp.low_pass = 0;
  Options blurred = centre;
  blurred.low_pass = 2.5F;
  SceneOptions mixed;
  mixed.count = 300;
  mixed.scale_min = 0.003;
  mixed.scale_max = 0.5;
  SceneOptions needles = mixed;
  needles.scale_min = 0.0005;
  needles.scale_max = 2;
  needles.count = 200;
  SceneOptions dense = mixed;
  dense.opacity_min = 0.8;
  dense.opacity_max = 1.2;
  dense.scale_min = 0.1;
  dense.sh_degree = 1;
  SceneOptions near = mixed;
  near.depth_min = -1;
  near.depth_max = 2;
  near.spread = 1.5;
  near.scale_max = 2;
  SceneOptions outside = mixed;  // most centres beyond the image's edges
  outside.spread = 4;
  outside.scale_max = 5;
  outside.scale_min = 0.1;
  SceneOptions bare = mixed;
  bare.has_tint = bare.has_bodies = bare.has_roughness = false;
  bare.sh_degree = 0;
  return {{"mixed", 53, 37, centre, mixed},       {"mixed_hit", 53, 37, hit, mixed},
          {"sharp", 48, 32, sharp, mixed},        {"blurred", 48, 32, blurred, mixed},
          {"needles", 50, 33, centre, needles},   {"needles_sharp", 50, 33, sharp, needles},
          {"needles_hit", 40, 30, hit, needles},  {"dense", 31, 50, centre, dense},
          {"dense_hit", 33, 17, hit, dense},      {"near", 45, 31, centre, near},
          {"near_hit", 45, 31, hit, near, 0.004}, {"outside", 45, 31, centre, outside},
          {"bare", 17, 16, centre, bare},         {"one_pixel", 1, 1, centre, mixed, 0}};
}

bool close(double found, double expected, double tolerance) {
  return std::abs(found - expected) <= tolerance * (1 + std::abs(expected));
}

// A scene drawn by both, and the pixels at which they differ.
struct Drawn {
  TestScene<float> scene;
  TestScene<double> truth;
  SavedPtr saved = make_saved();
  Output found;
  BasicOutput<double> expected;
  std::vector<int64_t> differing;
  std::string report;

  Drawn(const Case& c, uint64_t seed)
      : scene(convert_scene<float>(random_scene(seed, c.width, c.height, c.scene))),
        truth(convert_scene<double>(scene)) {
    set_threads(1);
    forward(scene.surfels, scene.camera, c.options, found, saved.get());
    forward_reference(truth.surfels, truth.camera, c.options, expected);
    for (int64_t pixel = 0; pixel < int64_t{c.width} * c.height; ++pixel) {
      if (!agrees(pixel, int64_t{c.width} * c.height)) differing.push_back(pixel);
    }
  }

 private:
  bool agrees(int64_t pixel, int64_t pixels) {
    const auto f = outputs_of(found);
    const auto e = outputs_of(expected);
    bool result = true;
    for (size_t o = 0; o < f.size(); ++o) {
      const int64_t channels = f[o]->size() / pixels;
      for (int64_t i = pixel * channels; i < (pixel + 1) * channels; ++i) {
        if (close((*f[o])[i], (*e[o])[i], 2e-5)) continue;
        result = false;
        report += std::string(output_names[o]) + " at " + std::to_string(pixel) + ": " +
                  std::to_string((*f[o])[i]) + " for " + std::to_string((*e[o])[i]) + "\n";
      }
    }
    return result;
  }
};

class CpuForward : public ::testing::TestWithParam<Case> {};

TEST_P(CpuForward, matches_the_reference) {
  const Case& c = GetParam();
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    const Drawn drawn(c, seed);
    EXPECT_LE(static_cast<double>(drawn.differing.size()), c.differing_share * c.width * c.height + 0.5)
        << "seed " << seed << "\n"
        << drawn.report;
    const auto alpha = drawn.expected.alpha.values();
    EXPECT_GT(*std::max_element(alpha.begin(), alpha.end()), 0.1) << "the scene shows nothing";
  }
}

double root_mean_square(const Tensor<double>& values) {
  double sum = 0;
  for (const double v : values.values()) sum += v * v;
  return std::sqrt(sum / static_cast<double>(std::max<int64_t>(values.size(), 1)));
}

// Counts the values that are off by more than `tolerance` of themselves and of the group's root mean square.
int64_t count_differing(const Tensor<float>& found, const Tensor<double>& expected, double tolerance,
                        std::string& report) {
  const double scale = root_mean_square(expected);
  int64_t differing = 0;
  for (int64_t i = 0; i < expected.size(); ++i) {
    if (std::abs(found[i] - expected[i]) <= tolerance * (std::abs(expected[i]) + scale)) continue;
    ++differing;
    report +=
        std::to_string(i) + ": " + std::to_string(found[i]) + " for " + std::to_string(expected[i]) + "\n";
  }
  return differing;
}

// The loss leaves out the pixels at which the images differ: a discontinuity lies between the two precisions
// there.
void expect_same_gradient(const Case& c, uint64_t seed, unsigned outputs) {
  const Drawn drawn(c, seed);
  auto weights = random_output_gradient<float>(seed + 50, c.width, c.height, outputs);
  BasicOutputGradient<double> true_weights;
  const auto w = outputs_of(weights);
  const auto t = outputs_of(true_weights);
  for (size_t o = 0; o < w.size(); ++o) {
    const int64_t channels = w[o]->size() / (int64_t{c.width} * c.height);
    for (const int64_t pixel : drawn.differing) std::fill_n(w[o]->data() + pixel * channels, channels, 0.0F);
    *t[o] = convert<double>(*w[o]);
  }
  InputGradient found;
  BasicInputGradient<double> expected;
  backward(drawn.scene.surfels, drawn.scene.camera, c.options, *drawn.saved, weights, found);
  backward_reference(drawn.truth.surfels, drawn.truth.camera, c.options, true_weights, expected);

  std::vector<const Tensor<float>*> groups;
  for_each_group(found.surfels, [&](const char*, const Tensor<float>& g) { groups.push_back(&g); });
  size_t group = 0;
  for_each_group(expected.surfels, [&](const char* name, const Tensor<double>& e) {
    std::string report;
    const int64_t differing = count_differing(*groups[group++], e, c.gradient_tolerance, report);
    EXPECT_LE(static_cast<double>(differing), c.gradient_share * static_cast<double>(e.size()))
        << name << ", seed " << seed << "\n"
        << report;
  });
  double scale = 0;
  for (int a = 0; a < 3; ++a) {
    scale += length(expected.camera.camera_from_world[a]) + std::abs(expected.camera.position[a]);
  }
  for (int a = 0; a < 3; ++a) {
    EXPECT_NEAR(found.camera.position[a], expected.camera.position[a], c.gradient_tolerance * scale);
    for (int b = 0; b < 3; ++b) {
      EXPECT_NEAR(found.camera.camera_from_world[a][b], expected.camera.camera_from_world[a][b],
                  c.gradient_tolerance * scale);
    }
  }
}

class CpuBackward : public ::testing::TestWithParam<Case> {};

TEST_P(CpuBackward, matches_the_reference) {
  for (uint64_t seed = 1; seed <= 2; ++seed) expect_same_gradient(GetParam(), seed, 0x1ff);
}

INSTANTIATE_TEST_SUITE_P(Cases, CpuBackward, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return test.param.name; });
TEST(CpuBackwardOfEachOutput, matches_the_reference) {
  for (const Case& c : cases()) {
    if (std::string(c.name) != "mixed" && std::string(c.name) != "mixed_hit") continue;
    for (unsigned output = 0; output < output_names.size(); ++output) {
      SCOPED_TRACE(output_names[output]);
      expect_same_gradient(c, 3, 1U << output);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, CpuForward, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace traceflow::raster

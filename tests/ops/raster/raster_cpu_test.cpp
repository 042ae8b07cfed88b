#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

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
};

std::vector<Case> cases() {
  Options centre;
  centre.background = {0.3F, 0.6F, 0.1F};
  Options hit = centre;
  hit.sort = SortOrder::hit;
  Options sharp = centre;
  sharp.low_pass = false;
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
  bare.has_tint = false;
  bare.sh_degree = 0;
  return {{"mixed", 83, 61, centre, mixed},
          {"mixed_hit", 83, 61, hit, mixed},
          {"sharp", 64, 48, sharp, mixed},
          {"needles", 75, 50, centre, needles},
          {"needles_sharp", 75, 50, sharp, needles},
          {"needles_hit", 40, 30, hit, needles},
          {"dense", 50, 70, centre, dense},
          {"dense_hit", 33, 17, hit, dense},
          {"near", 61, 40, centre, near},
          {"near_hit", 61, 40, hit, near, 0.004},
          {"outside", 61, 40, centre, outside},
          {"bare", 17, 16, centre, bare},
          {"one_pixel", 1, 1, centre, mixed, 0}};
}

bool close(double found, double expected, double tolerance) {
  return std::abs(found - expected) <= tolerance * (1 + std::abs(expected));
}

class CpuForward : public testing::TestWithParam<Case> {};

TEST_P(CpuForward, matches_the_reference) {
  const Case& c = GetParam();
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const auto scene = convert_scene<float>(random_scene(seed, c.width, c.height, c.scene));
    const auto truth = convert_scene<double>(scene);
    Output found;
    BasicOutput<double> expected;
    forward(scene.surfels, scene.camera, c.options, found, nullptr);
    forward_reference(truth.surfels, truth.camera, c.options, expected);
    const auto f = outputs_of(found);
    const auto e = outputs_of(expected);
    int64_t differing = 0;
    std::string first;
    for (int64_t pixel = 0; pixel < int64_t{c.width} * c.height; ++pixel) {
      bool agrees = true;
      for (size_t o = 0; o < f.size(); ++o) {
        const int64_t channels = f[o]->size() / (int64_t{c.width} * c.height);
        for (int64_t i = pixel * channels; i < (pixel + 1) * channels; ++i) {
          if (close((*f[o])[i], (*e[o])[i], 5e-5)) continue;
          agrees = false;
          first += first.size() > 400
                       ? ""
                       : std::string(output_names[o]) + " at " + std::to_string(pixel) + ": " +
                             std::to_string((*f[o])[i]) + " for " + std::to_string((*e[o])[i]) + "\n";
        }
      }
      differing += agrees ? 0 : 1;
    }
    EXPECT_LE(static_cast<double>(differing), c.differing_share * c.width * c.height + 0.5) << seed << "\n"
                                                                                            << first;
    EXPECT_GT(*std::max_element(expected.alpha.data(), expected.alpha.data() + expected.alpha.size()), 0.1);
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, CpuForward, testing::ValuesIn(cases()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace traceflow::raster

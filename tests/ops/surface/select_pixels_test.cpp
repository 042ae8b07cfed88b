#include <limits>

#include "ops/surface/surface.h"
#include "support/gradients.h"

namespace traceflow::surface {
namespace {

using namespace traceflow::testing;

// 10,000 pixels that are covered and face somewhere; their tints lie evenly in [0, 2·min_tint).
struct Layers {
  Tensor<float> alpha{{100, 100}}, tint{{100, 100}}, normal{{100, 100, 3}};

  explicit Layers(const SelectOptions& options) {
    alpha.fill(0.5F);
    normal.fill(0.5F);
    for (int64_t i = 0; i < 10000; ++i) tint[i] = 2 * options.min_tint * static_cast<float>(i) / 10000;
  }
};

TEST(SelectPixels, RenderingTracesExactlyWhatMatters) {
  const SelectOptions options;
  Layers layers(options);
  layers.alpha[9000] = 0;
  for (int c = 0; c < 3; ++c) layers.normal[3 * 9001 + c] = 0;
  const TracedPixels traced = select_pixels(layers.alpha, layers.tint, layers.normal, options, false, 1);
  std::vector<int32_t> expected;
  for (int32_t i = 0; i < 10000; ++i) {
    if (layers.tint[i] >= options.min_tint && i != 9000 && i != 9001) expected.push_back(i);
  }
  EXPECT_EQ(list_of(traced.pixel), expected);
  EXPECT_EQ(list_of(traced.weight), std::vector<float>(expected.size(), 1));
}

// Oracle: the number of probes is binomial(5000, share); six standard deviations either way. Their weights
// make up for the pixels that were left out.
TEST(SelectPixels, ProbesAreTheirShareOfTheRest) {
  SelectOptions options;
  for (const float share : {0.1F, 0.5F}) {
    options.probe_share = share;
    const Layers layers(options);
    const TracedPixels traced = select_pixels(layers.alpha, layers.tint, layers.normal, options, true, 7);
    double probes = 0;
    for (int64_t k = 0; k < traced.pixel.size(); ++k) {
      const bool matters = layers.tint[traced.pixel[k]] >= options.min_tint;
      EXPECT_FLOAT_EQ(traced.weight[k], matters ? 1 : 1 / share);
      probes += matters ? 0 : 1;
    }
    EXPECT_NEAR(probes, 5000 * share, 6 * std::sqrt(5000 * share * (1 - share)));
  }
}

TEST(SelectPixels, DrawsDependOnTheSeedAndOnThePixelAlone) {
  const SelectOptions options;
  Layers layers(options);
  const auto draw = [&](uint64_t seed) {
    return list_of(select_pixels(layers.alpha, layers.tint, layers.normal, options, true, seed).pixel);
  };
  const auto first = draw(1);
  EXPECT_EQ(first, draw(1));
  EXPECT_NE(first, draw(2));
  layers.alpha[first[0]] = 0;
  EXPECT_EQ(draw(1), std::vector<int32_t>(first.begin() + 1, first.end()));
}

TEST(SelectPixels, ShareZeroDrawsNoneAndShareOneDrawsAll) {
  SelectOptions options;
  options.probe_share = 0;
  const Layers layers(options);
  EXPECT_EQ(select_pixels(layers.alpha, layers.tint, layers.normal, options, true, 1).pixel.size(), 5000);
  options.probe_share = 1;
  EXPECT_EQ(select_pixels(layers.alpha, layers.tint, layers.normal, options, true, 1).pixel.size(), 10000);
}

TEST(SelectPixels, HostilePixelsAreNotTraced) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  SelectOptions options;
  options.probe_share = 0;
  Layers layers(options);
  layers.tint.fill(1);
  layers.alpha[1] = nan;
  layers.tint[2] = nan;
  layers.normal[3 * 3] = nan;
  layers.normal[3 * 4 + 2] = std::numeric_limits<float>::infinity();
  const TracedPixels traced = select_pixels(layers.alpha, layers.tint, layers.normal, options, true, 1);
  EXPECT_EQ(traced.pixel.size(), 9996);
  EXPECT_EQ(traced.pixel[1], 5);
  EXPECT_TRUE(select_pixels({}, {}, {}, options, true, 1).pixel.empty());
  EXPECT_THROW(select_pixels(layers.alpha, Tensor<float>({3}), layers.normal, options, true, 1),
               InternalError);
}

TEST(SelectPixels, OptionsOutsideTheirRangeAreRefused) {
  SelectOptions options;
  EXPECT_NO_THROW(options.validate());
  options.probe_share = 1.5F;
  EXPECT_THROW(options.validate(), InputError);
  options = {};
  options.min_tint = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(options.validate(), InputError);
}

}  // namespace
}  // namespace traceflow::surface

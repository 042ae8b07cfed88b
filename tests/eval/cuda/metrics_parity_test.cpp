#include <array>
#include <limits>

#include "eval/metrics.h"
#include "support/device.h"

namespace traceflow::eval {
namespace {

using namespace traceflow::testing;

using MetricsOnDevice = OnDevice;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

struct Case {
  Tensor<float> colour, normal;
  Tensor<float> true_colour, true_normal;
  Tensor<float> depth, alpha, true_depth;
  Tensor<uint8_t> mask;
};

Case random_case(int64_t height, int64_t width) {
  Random random(1);
  Case c;
  c.colour = random_tensor<float>({height, width, 3}, random, -0.1, 1.1);
  c.true_colour = random_tensor<float>({height, width, 3}, random, 0, 1);
  c.normal = random_tensor<float>({height, width, 3}, random, -1, 1);
  c.true_normal = random_tensor<float>({height, width, 3}, random, -1, 1);
  c.mask = Tensor<uint8_t>({height, width});
  // Pieces large enough to have a core.
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) c.mask(y, x) = y % 9 < 5 && x % 11 < 6 ? 255 : 0;
  }
  c.depth = random_tensor<float>({height, width}, random, -0.2, 4);
  c.alpha = random_tensor<float>({height, width}, random, 0.3, 1);
  c.true_depth = random_tensor<float>({height, width}, random, -0.5, 3);
  return c;
}

Metrics measured(const Case& c, Device pictures, Device truth) {
  const Tensor<float> colour = c.true_colour.on(truth), normal = c.true_normal.on(truth);
  const Tensor<uint8_t> mask = c.mask.on(truth);
  const Tensor<float> depth = c.true_depth.on(truth);
  return measure({c.colour.on(pictures), c.normal.on(pictures), c.depth.on(pictures), c.alpha.on(pictures)},
                 {colour, mask, normal, nullptr, &depth, 1.25}, nullptr);
}

void expect_agreement(const Metrics& found, const Metrics& expected) {
  std::vector<std::optional<double>> figures;
  Metrics::visit(expected, [&](const char*, const auto& value) { figures.push_back(value); });
  size_t k = 0;
  Metrics::visit(found, [&](const char* name, const std::optional<double>& value) {
    const std::optional<double>& wanted = figures[k++];
    ASSERT_EQ(value.has_value(), wanted.has_value()) << name;
    if (!value) return;
    if (std::isnan(*wanted)) {
      EXPECT_TRUE(std::isnan(*value)) << name;
      return;
    }
    // The pictures are the same numbers once they are rounded, and their sums are of doubles in another
    // order; but SSIM's moments are floats, and a variance is a small difference of them.
    const bool ssim = std::string_view(name).ends_with("ssim");
    EXPECT_NEAR(*value, *wanted, ssim ? 1e-5 : 1e-11 * std::abs(*wanted)) << name;
  });
}

void expect_agreement(const Case& c) {
  const Metrics expected = measured(c, Device::cpu, Device::cpu);
  for (const Device truth : {Device::cpu, Device::cuda})
    expect_agreement(measured(c, Device::cuda, truth), expected);
}

TEST_F(MetricsOnDevice, AgreeWithTheCpu) {
  const Case c = random_case(67, 83);  // more pixels than a block sums
  const Metrics m = measured(c, Device::cpu, Device::cpu);
  Metrics::visit(m, [](const char* name, const std::optional<double>& value) {
    const bool is_lpips = std::string_view(name).starts_with("lpips");
    EXPECT_NE(value.has_value(), is_lpips) << name;
  });
  expect_agreement(c);
}

TEST_F(MetricsOnDevice, AgreeOnWhatIsNotANumber) {
  Case c = random_case(20, 24);
  c.colour[5] = c.normal[5] = c.true_colour[100] = c.true_normal[100] = nan;
  c.colour[70] = c.normal[71] = c.true_colour[140] = c.true_normal[200] = infinity;
  c.colour[72] = -infinity;
  c.depth[5] = c.alpha[6] = c.true_depth[7] = nan;
  c.depth[8] = c.alpha[9] = c.true_depth[10] = infinity;
  c.normal[300] = 1e30F;  // whose square a double has
  expect_agreement(c);
}

TEST_F(MetricsOnDevice, AgreeWhereThereAreNoNormals) {
  Case c = random_case(12, 14);
  for (int64_t i = 0; i < c.normal.size() / 2; ++i) c.normal[i] = 0;
  expect_agreement(c);
  c.true_normal.zero();
  EXPECT_FALSE(measured(c, Device::cuda, Device::cpu).normal_mae_deg);
  expect_agreement(c);
  c.true_normal = {};
  c.normal = {};
  expect_agreement(c);
}

TEST_F(MetricsOnDevice, AgreeWithoutAMaskAndWithAnEmptyOne) {
  Case c = random_case(12, 14);
  c.mask.zero();
  expect_agreement(c);
  c.mask = {};
  expect_agreement(c);
  c.mask = Tensor<uint8_t>({12, 14});
  c.mask[50] = 1;
  expect_agreement(c);
}

TEST_F(MetricsOnDevice, EqualImagesHaveNoPsnr) {
  Case c = random_case(12, 14);
  c.colour = c.true_colour;
  c.normal = c.true_normal;
  const Metrics m = measured(c, Device::cuda, Device::cpu);
  EXPECT_FALSE(m.psnr || m.masked_psnr);
  EXPECT_NEAR(*m.ssim, 1, 1e-6);
  EXPECT_NEAR(*m.normal_mae_deg, 0, 1e-5);
  EXPECT_NEAR(*m.masked_normal_mae_deg, 0, 1e-5);
}

// Numbers at, just under and just over the middle between two levels.
TEST_F(MetricsOnDevice, RoundTo8BitAsTheCpuDoes) {
  Case c;
  c.colour = Tensor<float>({3, 255, 3});
  for (int64_t level = 0; level < 255; ++level) {
    const float middle = (static_cast<float>(level) + 0.5F) / 255;
    const std::array<float, 3> around = {std::nextafter(middle, 0.0F), middle, std::nextafter(middle, 1.0F)};
    for (int64_t k = 0; k < 3; ++k) std::fill_n(&c.colour(k, level, 0), 3, around[static_cast<size_t>(k)]);
  }
  c.true_colour = Tensor<float>(c.colour.shape());
  expect_agreement(c);
}

TEST_F(MetricsOnDevice, OfImagesAsTheyAreAgreeToo) {
  Case c = random_case(12, 14);
  const auto found = psnr(c.colour.on(Device::cuda), c.true_colour.on(Device::cuda), c.mask.on(Device::cuda));
  EXPECT_NEAR(*found, *psnr(c.colour, c.true_colour, c.mask), 1e-10);
  c.colour[0] = nan;
  EXPECT_FALSE(psnr(c.colour.on(Device::cuda), c.true_colour.on(Device::cuda), {}));
}

TEST_F(MetricsOnDevice, PicturesApartAreRefused) {
  const Case c = random_case(4, 5);
  const Tensor<float> there = c.colour.on(Device::cuda), normal_there = c.normal.on(Device::cuda);
  EXPECT_THROW(psnr(there, c.true_colour, {}), InternalError);
  EXPECT_THROW(psnr(there, there, c.mask), InternalError);
  EXPECT_THROW(normal_mae_deg(normal_there, c.true_normal, {}), InternalError);
  EXPECT_THROW(normal_mae_deg(normal_there, normal_there, c.mask), InternalError);
}

}  // namespace
}  // namespace traceflow::eval

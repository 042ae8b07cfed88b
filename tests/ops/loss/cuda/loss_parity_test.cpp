#include <limits>

#include "support/device.h"
#include "support/loss_values.h"

namespace traceflow::loss {
namespace {

using namespace traceflow::testing;

using LossOnDevice = OnDevice;

constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

// A picture of each kind: colours, and normals of which every seventh is missing.
struct Pictures {
  Tensor<float> image, target, normal, unit, tint;
  Tensor<uint8_t> known;  // one of three

  Pictures(int64_t height, int64_t width, uint64_t seed = 1) {
    Random random(seed);
    const Shape shape{height, width, 3};
    image = random_tensor<float>(shape, random, 0, 1);
    target = random_tensor<float>(shape, random, 0, 1);
    normal = random_tensor<float>(shape, random, -0.5, 0.5);
    unit = random_tensor<float>(shape, random, -1, 1);
    tint = random_tensor<float>({height, width}, random, 0, 1);
    known.resize({height, width});
    for (int64_t i = 0; i < known.size(); ++i) known[i] = i % 3 == 0 ? 1 : 0;
    for (int64_t i = 3; i < height * width; i += 7) std::fill_n(unit.data() + 3 * i, 3, 0.0F);
    for (int64_t i = 5; i < height * width; i += 7) std::fill_n(normal.data() + 3 * i, 3, 0.0F);
  }
  void spoil() {
    const float bad[] = {nan_f, infinity, -infinity, 1e30F, -1e30F};
    int k = 0;
    for (Tensor<float>* t : {&image, &target, &normal, &unit}) {
      for (int64_t i = 11; i < t->size(); i += 1003) (*t)[i] = bad[k++ % 5];
    }
  }
};

struct Result {
  double value;
  std::vector<Tensor<float>> gradients;
};

// Every term on a device, its gradients added to ones.
std::vector<Result> run(const Pictures& p, Device device) {
  const Tensor<float> image = p.image.on(device), target = p.target.on(device), normal = p.normal.on(device),
                      unit = p.unit.on(device);
  Tensor<float> ones(p.image.shape());
  ones.fill(1);
  const auto fresh = [&] { return ones.on(device); };
  std::vector<Result> all;
  const auto with = [&](size_t gradients, auto&& term) {
    Result r{0, std::vector<Tensor<float>>(gradients, fresh())};
    r.value = term(r.gradients);
    all.push_back(std::move(r));
  };
  with(1, [&](auto& g) { return l1(image, target, 0.8, g[0]); });
  with(1, [&](auto& g) { return ssim_loss(image, target, 70, g[0]); });
  with(3, [&](auto& g) {
    const Tensor<float> alpha = p.tint.on(device);
    g[1] = alpha;
    return normal_consistency(normal, alpha, unit, 0.05, g[0], g[1], g[2]);
  });
  with(1, [&](auto& g) { return normal_prior(normal, unit, 0.05, g[0]); });
  with(1, [&](auto& g) { return normal_prior(normal, unit, 0.05, g[0], p.tint.on(device), 7); });
  with(1, [&](auto& g) { return distortion(image, 3, g[0]); });
  with(1, [&](auto& g) { return depth_prior(image, target, 3, g[0]); });
  with(0, [&](auto&) { return squared_error(image, target); });
  with(0, [&](auto&) { return squared_error(image, target, p.known.on(device)); });
  with(0, [&](auto&) { return ssim(image, target, {}); });
  return all;
}

void expect_agreement(const std::vector<Result>& found, const std::vector<Result>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (size_t k = 0; k < found.size(); ++k) {
    EXPECT_EQ(std::isfinite(found[k].value), std::isfinite(expected[k].value)) << "term " << k;
    // Single precision under the sums, which differ in their order; SSIM's variances are differences of sums.
    if (std::isfinite(expected[k].value)) {
      EXPECT_NEAR(found[k].value, expected[k].value, 1e-5) << "term " << k;
    }
    for (size_t g = 0; g < found[k].gradients.size(); ++g) {
      ASSERT_TRUE(all_finite(expected[k].gradients[g]));
      expect_close_on_host(found[k].gradients[g], expected[k].gradients[g], 2e-5,
                           ("term " + std::to_string(k)).c_str());
    }
  }
}

TEST_F(LossOnDevice, AgreesWithTheCpu) {
  for (const auto& [height, width] : {std::pair{1, 1}, {3, 200}, {37, 29}, {32, 64}}) {
    const Pictures p(height, width);
    expect_agreement(run(p, Device::cuda), run(p, Device::cpu));
  }
}

TEST_F(LossOnDevice, HostilePixelsShowInTheValuesAndGiveNoGradient) {
  Pictures p(37, 29);
  p.spoil();
  const std::vector<Result> expected = run(p, Device::cpu);
  for (const Result& r : expected) EXPECT_FALSE(std::isfinite(r.value));
  expect_agreement(run(p, Device::cuda), expected);
}

TEST_F(LossOnDevice, SameBytesTwice) {
  const Pictures p(37, 29);
  const auto first = run(p, Device::cuda), second = run(p, Device::cuda);
  for (size_t k = 0; k < first.size(); ++k) {
    EXPECT_EQ(first[k].value, second[k].value);
    for (size_t g = 0; g < first[k].gradients.size(); ++g) {
      EXPECT_EQ(list_of(first[k].gradients[g].on(Device::cpu)),
                list_of(second[k].gradients[g].on(Device::cpu)));
    }
  }
}

// Smooth shading, where variances are small and rounding shows.
TEST_F(LossOnDevice, SsimAgreesWhereThePicturesAreSmooth) {
  Tensor<float> image({40, 48, 3}), target({40, 48, 3});
  for (int64_t i = 0; i < image.size(); ++i) {
    const int64_t pixel = i / 3, row = pixel / 48;
    const auto x = static_cast<float>(pixel % 48), y = static_cast<float>(row);
    target[i] = 0.5F + 0.4F * std::sin(x / 20) * std::cos(y / 15);
    image[i] = target[i] + 0.05F * std::sin(x / 3);
  }
  Tensor<float> expected(image.shape()), found(image.shape(), Device::cuda);
  const double value = ssim_loss(image, target, 1, expected);
  EXPECT_NEAR(ssim_loss(image.on(Device::cuda), target.on(Device::cuda), 1, found), value, 1e-5);
  expect_close_on_host(found, expected, 2e-3, "gradient");
}

TEST_F(LossOnDevice, AMaskRestrictsSsim) {
  const Pictures p(37, 29);
  Tensor<uint8_t> mask({37, 29});
  for (int64_t i = 0; i < mask.size(); ++i) mask[i] = i % 29 < 10 ? 255 : 0;
  const Tensor<float> image = p.image.on(Device::cuda), target = p.target.on(Device::cuda);
  EXPECT_NEAR(ssim(image, target, mask.on(Device::cuda)), ssim(p.image, p.target, mask), 1e-6);
  EXPECT_TRUE(std::isnan(ssim(image, target, Tensor<uint8_t>({37, 29}, Device::cuda))));
}

TEST_F(LossOnDevice, NothingWeighsNothing) {
  const Pictures none(0, 0);
  for (const Result& r : run(none, Device::cpu)) EXPECT_TRUE(r.value == 0 || std::isnan(r.value));
  const std::vector<Result> found = run(none, Device::cuda);
  for (size_t k = 0; k + 1 < found.size(); ++k) EXPECT_EQ(found[k].value, 0) << "term " << k;
  EXPECT_TRUE(std::isnan(found.back().value)) << "the metric";
  Tensor<float> unset({2, 2, 3}, Device::cuda), gradient({2, 2, 3}, Device::cuda);
  EXPECT_EQ(normal_prior(unset, unset, 1, gradient), 0);
  EXPECT_EQ(list_of(gradient.on(Device::cpu)), std::vector<float>(12, 0));
}

TEST_F(LossOnDevice, RowNormsAgree) {
  Random random(3);
  for (const int64_t count : {2, 300, 5000}) {
    Tensor<float> rows = random_tensor<float>({count, 10}, random, -1, 1);
    for (int64_t i = 0; i < count; i += 7) std::fill_n(rows.row(i), 10, i % 2 == 0 ? 0.0F : nan_f);
    Tensor<float> expected(rows.shape()), found(rows.shape(), Device::cuda);
    EXPECT_NEAR(row_norm(rows.on(Device::cuda), 0.3, found), row_norm(rows, 0.3, expected), 1e-6);
    expect_close_on_host(found, expected, 1e-5, "rows");
  }
  Tensor<float> none({0, 10}, Device::cuda), no_gradient({0, 10}, Device::cuda);
  EXPECT_EQ(row_norm(none, 0.3, no_gradient), 0);
}

TEST_F(LossOnDevice, ASlotElsewhereIsRefused) {
  Tensor<float> image({2, 2, 3}, Device::cuda);
  Tensor<Mean> here({1}), there({1}, Device::cuda);
  EXPECT_THROW(squared_error(image, image, {}, {here, 0}), InternalError);
  EXPECT_THROW(squared_error(image, image, {}, {there, 1}), InternalError);
}

}  // namespace
}  // namespace traceflow::loss

#include <limits>

#include "support/device.h"
#include "train/density.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using DensityOnDevice = OnDevice;

// What a checkpoint holds of two iterations' signals.
std::vector<float> statistics(Device device) {
  constexpr int64_t count = 300;
  Random random(1);
  DensityControl density("main", {}, count, device);
  for (int iteration = 0; iteration < 2; ++iteration) {
    Tensor<float> signal = random_tensor<float>({count}, random, 0, 1);
    Tensor<uint8_t> touched({count});
    for (uint8_t& t : touched.values()) t = static_cast<uint8_t>(random.below(2));
    signal[7] = std::numeric_limits<float>::quiet_NaN();
    touched[7] = 1;
    density.accumulate(signal.on(device), touched.on(device));
  }
  Safetensors file;
  density.put(file);
  std::vector<float> all = list_of(file.tensor<float>("density/main/sum"));
  const std::vector<float> seen = list_of(file.tensor<float>("density/main/seen"));
  all.insert(all.end(), seen.begin(), seen.end());
  return all;
}

struct Edited {
  Surfels surfels;
  SurfelMoments moments;
  events::DensityChanged change;
};

// Surfels of all fates after one round of density control and a reset of opacity.
Edited edited(Device device) {
  constexpr int64_t count = 300;
  Random random(3);
  Surfels s{
      random_tensor<float>({count, 3}, random, -1, 1),    random_tensor<float>({count, 2}, random, -7, 0),
      random_tensor<float>({count, 4}, random, -1, 1),    random_tensor<float>({count}, random, -4, 4),
      random_tensor<float>({count, 4, 3}, random, -1, 1), random_tensor<float>({count}, random, -1, 1)};
  s.roughness_logit = random_tensor<float>({count}, random, -1, 1);
  Edited e;
  e.surfels = s.on(device);
  e.moments.reset_like(e.surfels);
  e.moments.for_each([&](const std::string&, optimize::AdamState& state) {
    state.first = random_tensor<float>(state.first.shape(), random, -1, 1).on(device);
    state.second = random_tensor<float>(state.second.shape(), random, 0, 1).on(device);
    state.step = 5;
  });
  DensityOptions options;
  options.longest_needle = 0.05F;
  options.longest_unseen = 0.02F;
  options.clones_share_opacity = true;
  DensityControl density("main", options, count, device);
  const Tensor<float> signal = random_tensor<float>({count}, random, 0, 4e-4);
  Tensor<uint8_t> touched({count});
  touched.fill(1);
  density.accumulate(signal.on(device), touched.on(device));
  e.change = density.update(e.surfels, e.moments, {{.extent = 10, .cloud = 1}, 400}, random);
  density.reset_opacity(e.surfels, e.moments);
  density.shorten_needles(e.surfels, 1);
  Tensor<Camera<float>> cameras({1});
  cameras[0] = {.width = 100, .height = 100, .focal_x = 50, .focal_y = 50, .centre_x = 50, .centre_y = 50};
  density.shorten_unseen(e.surfels, cameras.on(device), 1);
  return e;
}

// Decisions are the host's for both; a scattered child's place takes an exp() that may round otherwise.
TEST_F(DensityOnDevice, EditsTheSetAsTheCpuDoes) {
  Edited expected = edited(Device::cpu), found = edited(Device::cuda);
  EXPECT_GT(expected.change.cloned, 10);
  EXPECT_GT(expected.change.split, 10);
  EXPECT_GT(expected.change.pruned_transparent, 10);
  EXPECT_EQ(found.change.cloned, expected.change.cloned);
  EXPECT_EQ(found.change.split, expected.change.split);
  EXPECT_EQ(found.change.count, expected.change.count);
  expect_close_on_host(found.surfels.position, expected.surfels.position, 1e-6, "position");
  expect_close_on_host(found.surfels.log_scale, expected.surfels.log_scale, 1e-6, "log-scale");
  EXPECT_EQ(list_of(found.surfels.sh.on(Device::cpu)), list_of(expected.surfels.sh));
  EXPECT_EQ(list_of(found.surfels.opacity_logit.on(Device::cpu)), list_of(expected.surfels.opacity_logit));
  std::vector<const optimize::AdamState*> states;
  expected.moments.for_each(
      [&](const std::string&, optimize::AdamState& state) { states.push_back(&state); });
  size_t k = 0;
  found.moments.for_each([&](const std::string& name, optimize::AdamState& state) {
    EXPECT_EQ(list_of(state.first.on(Device::cpu)), list_of(states[k]->first)) << name;
    EXPECT_EQ(list_of(state.second.on(Device::cpu)), list_of(states[k++]->second)) << name;
    EXPECT_EQ(state.step, 5);
  });
}

TEST_F(DensityOnDevice, AccumulatesWhatTheCpuDoes) {
  EXPECT_EQ(statistics(Device::cuda), statistics(Device::cpu));
}

}  // namespace
}  // namespace traceflow

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
  DensityControl density("main", {}, count);
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

TEST_F(DensityOnDevice, AccumulatesWhatTheCpuDoes) {
  EXPECT_EQ(statistics(Device::cuda), statistics(Device::cpu));
}

}  // namespace
}  // namespace traceflow

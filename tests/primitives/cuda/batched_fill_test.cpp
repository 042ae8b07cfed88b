#include "primitives/batched_fill.h"

#include "support/device.h"

namespace traceflow {
namespace {

using ZerosOnDevice = testing::OnDevice;

// Every size around a thread's and a block's share, more ranges than one kernel takes, and between any two of
// them a tensor that keeps its content.
TEST_F(ZerosOnDevice, FillWhatWasAddedAndNothingElse) {
  std::vector<Tensor<uint8_t>> filled, kept;
  for (const int64_t bytes : {0, 1, 15, 16, 17, 31, 4096, 32767, 32768, 32769, 70000}) {
    for (int i = 0; i < 40; ++i) {
      Tensor<uint8_t> tensor({bytes});
      tensor.fill(7);
      filled.push_back(tensor.on(Device::cuda));
      kept.push_back(filled.back());
      if (bytes > 5000 && i > 2) break;
    }
  }
  BatchedZeroFill zeros;
  for (Tensor<uint8_t>& tensor : filled) zeros.add(tensor);
  zeros.fill();
  for (size_t k = 0; k < filled.size(); ++k) {
    const Tensor<uint8_t> zero = filled[k].on(Device::cpu), seven = kept[k].on(Device::cpu);
    for (int64_t i = 0; i < zero.size(); ++i) {
      ASSERT_EQ(zero[i], 0) << zero.size() << " bytes, at " << i;
      ASSERT_EQ(seven[i], 7) << zero.size() << " bytes, at " << i;
    }
  }
}

TEST_F(ZerosOnDevice, FillTensorsOfTheHostToo) {
  Tensor<float> tensor({5});
  tensor.fill(1);
  BatchedZeroFill zeros;
  zeros.add(tensor);
  zeros.fill();
  for (const float value : tensor.values()) EXPECT_EQ(value, 0);
}

}  // namespace
}  // namespace traceflow

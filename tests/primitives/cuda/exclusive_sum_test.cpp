#include <numeric>

#include "primitives/sort.h"
#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using ExclusiveSum = OnDevice;

TEST_F(ExclusiveSum, IsTheSumOfWhatComesBefore) {
  Tensor<uint8_t> scratch;
  for (const int64_t n : {0, 1, 31, 1000}) {
    Random random(1);
    Tensor<int32_t> numbers({n});
    for (int32_t& v : numbers.values()) v = static_cast<int32_t>(random.below(5));
    std::vector<int32_t> expected(static_cast<size_t>(n));
    std::exclusive_scan(numbers.values().begin(), numbers.values().end(), expected.begin(), 0);

    const Tensor<int32_t> in = numbers.on(Device::cuda);
    Tensor<int32_t> out({n}, Device::cuda), same = in;
    cuda::exclusive_sum(in.data(), out.data(), n, scratch);
    cuda::exclusive_sum(same.data(), same.data(), n, scratch);
    EXPECT_EQ(list_of(out.on(Device::cpu)), expected);
    EXPECT_EQ(list_of(same.on(Device::cpu)), expected);
  }
}

TEST_F(ExclusiveSum, Of64BitsGoesBeyond32) {
  Tensor<uint8_t> scratch;
  Tensor<int64_t> numbers({4});
  for (int64_t& v : numbers.values()) v = int64_t{1} << 31;
  Tensor<int64_t> on_device = numbers.on(Device::cuda);
  cuda::exclusive_sum(on_device.data(), on_device.data(), 4, scratch);
  EXPECT_EQ(on_device.on(Device::cpu)[3], int64_t{3} << 31);
}

}  // namespace
}  // namespace traceflow

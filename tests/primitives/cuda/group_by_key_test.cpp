#include "primitives/group_by_key.h"

#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using ListsOnDevice = OnDevice;

TEST_F(ListsOnDevice, HoldEveryEntryUnderItsKeyInOrder) {
  cuda::KeyGroups lists;
  Random random(1);
  for (const auto& [n, keys] : {std::pair{0, 3}, {1, 1}, {500, 7}, {300, 1}, {40, 900}}) {
    Tensor<int32_t> key({n});
    for (int32_t& k : key.values()) k = static_cast<int32_t>(random.below(keys + 1)) - 1;
    cuda::group_by_key(key.on(Device::cuda).data(), n, keys, lists);

    const Tensor<int32_t> begin = lists.begin.on(Device::cpu), entry = lists.entry.on(Device::cpu);
    for (int32_t k = 0; k < keys; ++k) {
      std::vector<int32_t> expected;
      for (int32_t i = 0; i < n; ++i) {
        if (key[i] == k) expected.push_back(i);
      }
      EXPECT_EQ(std::vector<int32_t>(entry.data() + begin[k], entry.data() + begin[k + 1]), expected);
    }
  }
}

}  // namespace
}  // namespace traceflow

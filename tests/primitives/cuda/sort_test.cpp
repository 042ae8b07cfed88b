#include "primitives/sort.h"

#include <algorithm>
#include <vector>

#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using SortOnDevice = OnDevice;

template <class Key>
void expect_sorted(int64_t n, int bits) {
  struct Item {
    Key key;
    uint32_t value;
  };
  Random random(static_cast<uint64_t>(n + bits));
  Tensor<Key> keys({n});
  Tensor<uint32_t> values({n});
  std::vector<Item> items;
  const Key mask = bits == 8 * sizeof(Key) ? ~Key{0} : (Key{1} << bits) - 1;
  for (int64_t i = 0; i < n; ++i) {
    keys[i] = static_cast<Key>(random.below(int64_t{1} << 40)) * Key{0x9e3779b9};
    values[i] = static_cast<uint32_t>(i);
    items.push_back({keys[i], values[i]});
  }
  std::stable_sort(items.begin(), items.end(),
                   [mask](const Item& a, const Item& b) { return (a.key & mask) < (b.key & mask); });
  const Tensor<Key> from = keys.on(Device::cuda);
  const Tensor<uint32_t> named = values.on(Device::cuda);
  Tensor<Key> sorted({n}, Device::cuda);
  Tensor<uint32_t> sorted_values({n}, Device::cuda);
  Tensor<uint8_t> scratch;
  cuda::sort_pairs(n, bits, from.data(), sorted.data(), named.data(), sorted_values.data(), scratch);
  const Tensor<Key> found = sorted.on(Device::cpu);
  const Tensor<uint32_t> found_values = sorted_values.on(Device::cpu);
  for (int64_t i = 0; i < n; ++i) {
    ASSERT_EQ(found[i], items[static_cast<size_t>(i)].key) << i;
    ASSERT_EQ(found_values[i], items[static_cast<size_t>(i)].value) << i;
  }
}

TEST_F(SortOnDevice, SortsByTheLowestBitsAndKeepsTheOrderOfEqualKeys) {
  for (const int64_t n : {0, 1, 2, 1000, 50000}) {
    for (const int bits : {3, 20, 64}) expect_sorted<uint64_t>(n, bits);
    for (const int bits : {3, 20, 32}) expect_sorted<uint32_t>(n, bits);
  }
}

}  // namespace
}  // namespace traceflow

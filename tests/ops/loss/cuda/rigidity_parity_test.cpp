#include <limits>

#include "support/device.h"
#include "support/loss_values.h"

namespace traceflow::loss {
namespace {

using namespace traceflow::testing;

using RigidityOnDevice = OnDevice;

struct Cloud {
  Tensor<float> rest, posed;
  Tensor<int32_t> subset;
  Neighbours edges;
};

// Points in a box, posed a little elsewhere; as a subset when every third is left out.
Cloud make_cloud(int64_t count, bool leave_some_out) {
  Random random(5);
  Cloud c;
  c.rest = random_tensor<float>({count, 3}, random, -1, 1);
  c.edges = spread_neighbours(c.rest, 8, 2);
  std::vector<int32_t> subset;
  for (int32_t i = 0; i < count; ++i) {
    if (!leave_some_out || i % 3 != 0) subset.push_back(i);
  }
  c.posed.reset({static_cast<int64_t>(subset.size()), 3});
  for (int64_t i = 0; i < c.posed.size(); ++i) {
    c.posed[i] =
        c.rest(subset[static_cast<size_t>(i / 3)], i % 3) + static_cast<float>(random.uniform(-0.2, 0.2));
  }
  if (leave_some_out) c.subset = tensor_of(subset);
  return c;
}

struct RigidityResult {
  double value;
  Tensor<float> rest, posed;
};

RigidityResult run(const Cloud& c, Device device) {
  RigidityResult r{0, Tensor<float>(c.rest.shape(), device), Tensor<float>(c.posed.shape(), device)};
  const Neighbours edges{c.edges.index.on(device), c.edges.distance2.on(device)};
  r.value =
      rigidity(c.rest.on(device), c.posed.on(device), c.subset.on(device), edges, 0.2, 0.7, r.rest, r.posed);
  return r;
}

void expect_agreement(const Cloud& c) {
  const RigidityResult expected = run(c, Device::cpu), found = run(c, Device::cuda);
  ASSERT_TRUE(all_finite(expected.rest) && all_finite(expected.posed));
  // A stretch is a difference of lengths that are alike.
  EXPECT_NEAR(found.value, expected.value, 1e-5);
  expect_close_on_host(found.rest, expected.rest, 1e-4, "rest");
  expect_close_on_host(found.posed, expected.posed, 1e-4, "posed");
}

TEST_F(RigidityOnDevice, AgreesWithTheCpu) {
  for (const bool leave_some_out : {false, true}) {
    for (const int64_t count : {2, 60, 700}) {
      if (count > 2 || !leave_some_out) expect_agreement(make_cloud(count, leave_some_out));
    }
  }
}

// One surfel that all the others are bound to.
TEST_F(RigidityOnDevice, AgreesWhereManyEdgesMeet) {
  Cloud c = make_cloud(300, false);
  for (int64_t i = 1; i < 300; ++i) c.edges.index(i, 3) = 0;
  expect_agreement(c);
}

TEST_F(RigidityOnDevice, WhatIsNotANumberIsLeftOut) {
  Cloud c = make_cloud(60, true);
  c.posed(3, 1) = std::numeric_limits<float>::quiet_NaN();
  c.rest(7, 0) = std::numeric_limits<float>::infinity();
  std::copy_n(c.rest.row(10), 3, c.rest.row(11));
  c.edges.index(13, 0) = -1;
  expect_agreement(c);
}

TEST_F(RigidityOnDevice, WithoutEdgesIsZero) {
  Cloud c = make_cloud(8, false);
  c.edges.index.fill(-1);
  const RigidityResult lone = run(c, Device::cuda);
  EXPECT_EQ(lone.value, 0);
  EXPECT_EQ(list_of(lone.posed.on(Device::cpu)), std::vector<float>(24, 0));
  c.posed.resize({0, 3});
  EXPECT_EQ(run(c, Device::cuda).value, 0);
}

TEST_F(RigidityOnDevice, SameBytesTwice) {
  const Cloud c = make_cloud(300, true);
  const RigidityResult first = run(c, Device::cuda), second = run(c, Device::cuda);
  EXPECT_EQ(first.value, second.value);
  EXPECT_EQ(list_of(first.rest.on(Device::cpu)), list_of(second.rest.on(Device::cpu)));
  EXPECT_EQ(list_of(first.posed.on(Device::cpu)), list_of(second.posed.on(Device::cpu)));
}

}  // namespace
}  // namespace traceflow::loss

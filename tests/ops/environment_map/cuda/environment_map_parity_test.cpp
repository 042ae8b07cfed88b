#include <limits>

#include "ops/environment_map/environment_map.h"
#include "support/device.h"

namespace traceflow::environment_map {
namespace {

using namespace traceflow::testing;

using EnvironmentMapOnDevice = OnDevice;

Tensor<float> noise(const Shape& shape, uint64_t seed) {
  Random random(seed);
  Tensor<float> t(shape);
  for (float& v : t.values()) v = static_cast<float>(random.normal());
  return t;
}

struct Results {
  Tensor<float> colour, logit, directions;
};

Results run(const Tensor<float>& logit, const Tensor<float>& directions, Device device) {
  Tensor<float> grad_colour = noise(directions.shape(), 3);
  if (grad_colour.size() > 30) grad_colour[20] = std::numeric_limits<float>::quiet_NaN();
  Results r;
  r.logit = Tensor<float>(logit.shape(), device);
  r.directions = Tensor<float>(directions.shape(), device);
  forward(logit.on(device), directions.on(device), r.colour);
  backward(logit.on(device), directions.on(device), grad_colour.on(device), r.logit, r.directions);
  return r;
}

void expect_agreement(const Tensor<float>& logit, const Tensor<float>& directions) {
  const Results expected = run(logit, directions, Device::cpu), found = run(logit, directions, Device::cuda);
  // A look-up's fraction is rounded in units of the map's size, the sum over rays in their order.
  expect_close_on_host(found.colour, expected.colour, 1e-5, "colour");
  expect_close_on_host(found.logit, expected.logit, 1e-4, "logit");
  expect_close_on_host(found.directions, expected.directions, 1e-4, "directions");
}

TEST_F(EnvironmentMapOnDevice, AgreesWithTheCpu) {
  for (const int64_t size : {2, 7, 16}) {
    for (const int64_t rays : {1, 3000}) expect_agreement(noise({6 * size, size, 3}, 1), noise({rays, 3}, 2));
  }
}

TEST_F(EnvironmentMapOnDevice, UnusableDirectionsSeeBlackAndPassNothing) {
  Tensor<float> directions = noise({400, 3}, 2);
  std::fill_n(directions.row(3), 3, 0.0F);
  directions(5, 1) = std::numeric_limits<float>::quiet_NaN();
  directions(7, 2) = std::numeric_limits<float>::infinity();
  directions(9, 0) = 1e-45F;
  directions(11, 0) = 3e38F;
  Tensor<float> logit = noise({30, 5, 3}, 1);
  expect_agreement(logit, directions);
  logit[30] = std::numeric_limits<float>::quiet_NaN();
  const Results r = run(logit, directions, Device::cuda);
  EXPECT_TRUE(all_finite(r.logit.on(Device::cpu)) && all_finite(r.directions.on(Device::cpu)));
}

TEST_F(EnvironmentMapOnDevice, NoRaysIsFine) {
  const Results r = run(noise({12, 2, 3}, 1), Tensor<float>(Shape{0, 3}), Device::cuda);
  EXPECT_EQ(r.colour.size(), 0);
  EXPECT_EQ(list_of(r.logit.on(Device::cpu)), std::vector<float>(72, 0));
}

TEST_F(EnvironmentMapOnDevice, SameBytesTwice) {
  const Tensor<float> logit = noise({18, 3, 3}, 1), directions = noise({2000, 3}, 2);
  const Results a = run(logit, directions, Device::cuda), b = run(logit, directions, Device::cuda);
  EXPECT_EQ(list_of(a.logit.on(Device::cpu)), list_of(b.logit.on(Device::cpu)));
}

}  // namespace
}  // namespace traceflow::environment_map

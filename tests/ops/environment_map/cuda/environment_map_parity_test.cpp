#include <limits>

#include "ops/environment_map/environment_map.h"
#include "support/device.h"

namespace traceflow::environment_map {
namespace {

using namespace traceflow::testing;

using EnvironmentMapOnDevice = OnDevice;

struct Results {
  Tensor<float> colour, grad_logit, grad_directions;
};

// Gradients are added to what is there.
Results run(Device device, const Tensor<float>& logit, const Tensor<float>& directions,
            const Tensor<float>& grad_colour) {
  Results r;
  r.grad_logit = logit.on(device);
  r.grad_directions = directions.on(device);
  forward(logit.on(device), directions.on(device), r.colour);
  backward(logit.on(device), directions.on(device), grad_colour.on(device), r.grad_logit, r.grad_directions);
  return {r.colour.on(Device::cpu), r.grad_logit.on(Device::cpu), r.grad_directions.on(Device::cpu)};
}

void expect_same(const Results& found, const Results& expected) {
  // The sums of a texel are made in another order; a look-up near a face's edge magnifies rounding by the
  // face's size.
  expect_close(found.colour, expected.colour, 1e-5, "colour");
  expect_close(found.grad_logit, expected.grad_logit, 1e-5, "grad_logit");
  expect_close(found.grad_directions, expected.grad_directions, 1e-4, "grad_directions");
}

TEST_F(EnvironmentMapOnDevice, AgreesWithTheCpu) {
  Random random(1);
  for (const int64_t size : {1, 2, 7}) {
    const Tensor<float> logit = random_tensor<float>({6 * size, size, 3}, random, -2, 2);
    Tensor<float> directions = random_tensor<float>({500, 3}, random, -1, 1);
    for (int64_t k = 0; k < 3; ++k) directions(0, k) = 0.5F;  // a corner
    const Tensor<float> grad_colour = random_tensor<float>({500, 3}, random, -1, 1);
    expect_same(run(Device::cuda, logit, directions, grad_colour),
                run(Device::cpu, logit, directions, grad_colour));
  }
}

TEST_F(EnvironmentMapOnDevice, SameBytesEveryRunAndWithoutRays) {
  Random random(2);
  const Tensor<float> logit = random_tensor<float>({24, 4, 3}, random, -2, 2);
  const Tensor<float> directions = random_tensor<float>({300, 3}, random, -1, 1);
  const Tensor<float> grad_colour = random_tensor<float>({300, 3}, random, -1, 1);
  const Results one = run(Device::cuda, logit, directions, grad_colour);
  const Results other = run(Device::cuda, logit, directions, grad_colour);
  EXPECT_EQ(list_of(one.grad_logit), list_of(other.grad_logit));
  const Tensor<float> none({0, 3});
  EXPECT_EQ(list_of(run(Device::cuda, logit, none, none).grad_logit), list_of(logit));
}

TEST_F(EnvironmentMapOnDevice, RaysThatCannotBeLookedUp) {
  Random random(3);
  const Tensor<float> logit = random_tensor<float>({18, 3, 3}, random, -2, 2);
  Tensor<float> directions = random_tensor<float>({20, 3}, random, -1, 1);
  Tensor<float> grad_colour = random_tensor<float>({20, 3}, random, -1, 1);
  for (int64_t k = 0; k < 3; ++k) directions(0, k) = 0;
  grad_colour(1, 2) = std::numeric_limits<float>::quiet_NaN();
  grad_colour(2, 0) = std::numeric_limits<float>::infinity();
  for (int64_t k = 0; k < 3; ++k) directions(3, k) = std::numeric_limits<float>::denorm_min();
  for (int64_t k = 0; k < 3; ++k) directions(4, k) = std::numeric_limits<float>::max();
  expect_same(run(Device::cuda, logit, directions, grad_colour),
              run(Device::cpu, logit, directions, grad_colour));
  Tensor<float> colour;
  directions(5, 1) = std::numeric_limits<float>::quiet_NaN();
  directions(6, 1) = -std::numeric_limits<float>::infinity();
  forward(logit.on(Device::cuda), directions.on(Device::cuda), colour);
  const Tensor<float> found = colour.on(Device::cpu);
  for (const int64_t ray : {0, 5, 6}) EXPECT_EQ(found(ray, 0), 0);
  EXPECT_TRUE(all_finite(found));
}

}  // namespace
}  // namespace traceflow::environment_map

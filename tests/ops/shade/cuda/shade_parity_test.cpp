#include "ops/shade/shade.h"
#include "support/device.h"

namespace traceflow::shade {
namespace {

using namespace traceflow::testing;

using ShadeOnDevice = OnDevice;

TEST_F(ShadeOnDevice, AgreesWithTheCpu) {
  Random random(3);
  const Tensor<float> diffuse = random_tensor<float>({37, 29, 3}, random, 0, 1);
  const Tensor<float> tint = random_tensor<float>({37, 29}, random, 0, 1);
  const Tensor<float> grad_colour = random_tensor<float>({37, 29, 3}, random, -1, 1);
  std::vector<int32_t> listed;
  for (int32_t i = 2; i < 37 * 29; i += 1 + i % 3) listed.push_back(i);
  const Tensor<int32_t> pixels = tensor_of(listed);
  const Tensor<float> weights = random_tensor<float>({pixels.size()}, random, 0, 10);
  const Tensor<float> specular = random_tensor<float>({pixels.size(), 3}, random, 0, 1);

  struct Results {
    Tensor<float> colour, diffuse, tint, specular;
  };
  const auto run = [&](Device device) {
    Results r;
    r.tint = Tensor<float>(tint.shape(), device);
    forward(diffuse.on(device), tint.on(device), pixels.on(device), specular.on(device), r.colour);
    backward(diffuse.on(device), tint.on(device), pixels.on(device), weights.on(device), specular.on(device),
             grad_colour.on(device), r.diffuse, r.tint, r.specular);
    return r;
  };
  const Results expected = run(Device::cpu), found = run(Device::cuda);
  // One product more or less fused is one rounding.
  expect_close_on_host(found.colour, expected.colour, 1e-6, "colour");
  expect_close_on_host(found.diffuse, expected.diffuse, 1e-6, "grad_diffuse");
  expect_close_on_host(found.tint, expected.tint, 1e-6, "grad_tint");
  expect_close_on_host(found.specular, expected.specular, 1e-6, "grad_specular");
}

TEST_F(ShadeOnDevice, NothingTracedIsTheDiffuseImage) {
  Random random(4);
  const Tensor<float> diffuse = random_tensor<float>({5, 7, 3}, random, 0, 1);
  Tensor<float> colour;
  forward(diffuse.on(Device::cuda), Tensor<float>({5, 7}, Device::cuda), Tensor<int32_t>({0}, Device::cuda),
          Tensor<float>({0, 3}, Device::cuda), colour);
  expect_close_on_host(colour, diffuse, 0, "colour");
}

}  // namespace
}  // namespace traceflow::shade

#include "../lighting_scene.h"
#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;
using LightingOnDevice = OnDevice;

TEST_F(LightingOnDevice, AgreesWithTheCpu) {
  for (const int degree : {0, 3}) {
    const Lighting lighting = random_lighting(4, 2);
    const PosedSurfels posed = random_posed(700, degree);
    const Tensor<int32_t> body = bodies_in_turn(700, 2);
    const LightingPass expected = run_lighting(Device::cpu, lighting, body, 0.42F, posed);
    const LightingPass found = run_lighting(Device::cuda, lighting, body, 0.42F, posed);
    expect_close(found.lit.sh, expected.lit.sh, 5e-6, "sh");
    expect_close(found.grad_posed.sh, expected.grad_posed.sh, 5e-6, "by sh");
    expect_close(found.grad_posed.position, expected.grad_posed.position, 1e-5, "by position");
    expect_close(found.grad_lighting.brightness, expected.grad_lighting.brightness, 1e-5, "by brightness");
    expect_close(found.grad_lighting.body_brightness, expected.grad_lighting.body_brightness, 1e-5,
                 "by brightness of bodies");
    Lighting here = zeros_like<float>(lighting), there = here.on(Device::cuda);
    lighting::resist(lighting, {0.3, 0.2, 0.1}, here);
    lighting::resist(lighting.on(Device::cuda), {0.3, 0.2, 0.1}, there);
    expect_close(there.brightness.on(Device::cpu), here.brightness, 1e-5, "resistance");
    expect_close(there.body_brightness.on(Device::cpu), here.body_brightness, 1e-5, "resistance on bodies");
  }
}

TEST_F(LightingOnDevice, IsTheSameBytesTwice) {
  const Lighting lighting = random_lighting(4, 2);
  const PosedSurfels posed = random_posed(3000, 2);
  const Tensor<int32_t> body = bodies_in_turn(3000, 2);
  const LightingPass once = run_lighting(Device::cuda, lighting, body, 0.42F, posed);
  const LightingPass twice = run_lighting(Device::cuda, lighting, body, 0.42F, posed);
  EXPECT_TRUE(same_bytes(once.lit.sh, twice.lit.sh));
  EXPECT_TRUE(same_bytes(once.grad_lighting.brightness, twice.grad_lighting.brightness));
  EXPECT_TRUE(same_bytes(once.grad_lighting.body_brightness, twice.grad_lighting.body_brightness));
}

}  // namespace
}  // namespace traceflow

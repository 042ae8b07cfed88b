#include "viz/probe.h"

#include "render/cloud.h"
#include "support/device.h"

namespace traceflow::viz {
namespace {

using namespace traceflow::testing;

using ProbeOnDevice = OnDevice;

TEST_F(ProbeOnDevice, AgreesWithTheCpu) {
  Fixture f;
  Renderer on_cpu(RenderOptions{}), on_cuda(RenderOptions{});
  const ProbeResult expected = probe(on_cpu, f.scene, f.request, 32, 24).value();
  f.scene.move_to(Device::cuda);
  const std::optional<ProbeResult> found = probe(on_cuda, f.scene, f.request, 32, 24);
  ASSERT_TRUE(found && found->mirrored && expected.mirrored);
  const auto expect_near = [](const Vec3<float>& a, const Vec3<float>& b, const char* what) {
    EXPECT_LT(length(a - b), 1e-3F) << what;
  };
  expect_near(found->surface, expected.surface, "surface");
  expect_near(found->normal, expected.normal, "normal");
  expect_near(found->colour, expected.colour, "colour");
  expect_near(found->specular, expected.specular, "specular");
  expect_near(found->mirrored->direction, expected.mirrored->direction, "direction");
  expect_near(found->mirrored->end, expected.mirrored->end, "end");
  EXPECT_NEAR(found->mirrored->alpha, expected.mirrored->alpha, 1e-4F);
}

}  // namespace
}  // namespace traceflow::viz

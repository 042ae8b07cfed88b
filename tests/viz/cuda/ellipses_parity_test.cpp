#include "viz/ellipses.h"

#include "render/cloud.h"
#include "support/device.h"
#include "viz/layers.h"

namespace traceflow::viz {
namespace {

using namespace traceflow::testing;

using EllipsesOnDevice = OnDevice;

TEST_F(EllipsesOnDevice, ComeToTheHost) {
  const Fixture f;
  Renderer renderer(RenderOptions{});
  const Frame& frame = renderer.forward(f.scene, f.request);
  const Tensor<float> expected = layer_values(frame, Layer::surfels, 1);
  const Tensor<float> found = surfel_ellipses(frame.main.on(Device::cuda), frame.camera, frame.drawn_with);
  EXPECT_EQ(found.device(), Device::cpu);
  EXPECT_EQ(list_of(found), list_of(expected));
}

}  // namespace
}  // namespace traceflow::viz

#include "viz/layers.h"

#include "support/device.h"

namespace traceflow::viz {
namespace {

using namespace traceflow::testing;

using LayersOnDevice = OnDevice;

TEST_F(LayersOnDevice, ComeToTheHost) {
  Random random(2);
  const auto noise = [&](const Shape& shape) {
    return random_tensor<float>(shape, random, 0, 1).on(Device::cuda);
  };
  Frame frame;
  for (Tensor<float>* image : {&frame.colour, &frame.raster.colour, &frame.raster.normal})
    *image = noise({6, 7, 3});
  for (Tensor<float>* plane : {&frame.raster.alpha, &frame.raster.tint, &frame.raster.depth,
                               &frame.raster.median_depth, &frame.raster.distortion}) {
    *plane = noise({6, 7});
  }
  frame.specular_rays.resize({0, 3});
  for (size_t i = 0; i < layer_names.size(); ++i) {
    const auto layer = static_cast<Layer>(i);
    if (layer == Layer::specular) continue;  // Frame makes it
    const Tensor<float> values = layer_values(frame, layer, 1);
    EXPECT_EQ(values.device(), Device::cpu) << layer_names[i];
    EXPECT_TRUE(all_finite(values)) << layer_names[i];
  }
  const Tensor<float> depth = frame.raster.depth.on(Device::cpu);
  EXPECT_EQ(layer_values(frame, Layer::depth, 0.5)[3], static_cast<float>(depth[3] / 0.5));
}

}  // namespace
}  // namespace traceflow::viz

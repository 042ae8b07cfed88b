#include "render/cloud.h"
#include "render/visibility.h"
#include "support/device.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using RendererOnDevice = OnDevice;

Scene on_device(Scene scene) {
  scene.move_to(Device::cuda);
  return scene;
}

// How many pixels differ by more than rounding. A disk that ends, a hit that falls under a cut-off, or a ray
// that mirrors at another of two equal depths moves single pixels; a mistake moves many.
double share_beyond(const Tensor<float>& on_device, const Tensor<float>& expected, double tolerance) {
  const Tensor<float> found = on_device.on(Device::cpu);
  EXPECT_EQ(found.shape(), expected.shape());
  double largest = 0;
  for (const float v : expected.values()) largest = std::max(largest, std::abs(static_cast<double>(v)));
  EXPECT_GT(largest, 0);
  int64_t beyond = 0;
  for (int64_t i = 0; i < found.size(); ++i) {
    if (!(std::abs(found[i] - expected[i]) <= tolerance * largest)) ++beyond;
  }
  return static_cast<double>(beyond) / static_cast<double>(found.size());
}

void expect_same_frames(const Frame& found, const Frame& expected) {
  constexpr double tolerance = 2e-4, few = 2e-3;
  EXPECT_LE(share_beyond(found.colour, expected.colour, tolerance), few) << "colour";
  EXPECT_LE(share_beyond(found.raster.colour, expected.raster.colour, tolerance), few) << "diffuse";
  EXPECT_LE(share_beyond(found.raster.alpha, expected.raster.alpha, tolerance), few) << "alpha";
  EXPECT_LE(share_beyond(found.raster.tint, expected.raster.tint, tolerance), few) << "tint";
  EXPECT_LE(share_beyond(found.raster.normal, expected.raster.normal, tolerance), few) << "normal";
  EXPECT_LE(share_beyond(found.raster.depth, expected.raster.depth, tolerance), few) << "depth";
  if (!expected.pseudo_normal.empty()) {
    // A cross product of differences of depths loses digits.
    EXPECT_LE(share_beyond(found.pseudo_normal, expected.pseudo_normal, 1e-2), few) << "pseudo-normal";
  }
  EXPECT_NEAR(found.max_displacement.on(Device::cpu)[0], expected.max_displacement[0],
              1e-5F * expected.max_displacement[0]);
  EXPECT_EQ(list_of(found.subset.on(Device::cpu)), list_of(expected.subset));
}

TEST_F(RendererOnDevice, ReusesAPose) {
  Fixture f;
  const Scene placed = on_device(f.scene);
  Renderer on_cpu(RenderOptions{}), on_cuda(RenderOptions{});
  on_cuda.forward(placed, f.request);
  f.request.camera.position.x = 0.3F;
  const Frame& expected = on_cpu.forward(f.scene, f.request);
  f.request.reuse_pose = true;
  const Frame& found = on_cuda.forward(placed, f.request);
  expect_same_frames(found, expected);
  ASSERT_EQ(found.mirrored.distance.size(), found.traced.pixel.size());
  if (found.traced.pixel.size() == expected.traced.pixel.size()) {
    EXPECT_LE(share_beyond(found.mirrored.distance, expected.mirrored.distance, 1e-3), 1e-2);
  }
}

TEST_F(RendererOnDevice, FramesAgreeWithTheCpu) {
  Fixture f;
  const Scene placed = on_device(f.scene);
  f.request.pseudo_normals = true;
  f.request.probes = true;
  f.request.probe_seed = 5;
  Renderer on_cpu(RenderOptions{}), on_cuda(RenderOptions{});
  for (const bool cull : {false, true}) {
    f.request.cull = cull;
    const Frame& expected = on_cpu.forward(f.scene, f.request);
    const Frame& found = on_cuda.forward(placed, f.request);
    ASSERT_GT(expected.traced.pixel.size(), 100);
    expect_same_frames(found, expected);
    EXPECT_LE(share_beyond(found.colour, expected.colour, 2e-4), 2e-3);
    EXPECT_LE(share_beyond(Tensor<float>(found.specular_image()), expected.specular_image(), 2e-4), 5e-3);
  }
}

TEST_F(RendererOnDevice, AViewOfNothingIsTheBackground) {
  Fixture f;
  const Scene placed = on_device(f.scene);
  f.request.cull = true;
  f.request.camera.position = {0, 0, 50};
  RenderOptions options;
  options.raster.background = {0.25F, 0.5F, 0.75F};
  Renderer renderer(options);
  const Frame& frame = renderer.forward(placed, f.request, true);
  EXPECT_EQ(frame.main.count(), 0);
  EXPECT_EQ(frame.colour.on(Device::cpu)(3, 4, 1), 0.5F);
  FrameGradient grad_frame;
  grad_frame.colour.place(Device::cuda).reset(frame.colour.shape());
  SceneGradient gradient;
  gradient.reset(placed);
  renderer.backward(placed, f.request, Trainable{}, grad_frame, gradient);
  const Tensor<float> position = gradient.main.position.on(Device::cpu);
  for (const float v : position.values()) ASSERT_EQ(v, 0);
}

TEST_F(RendererOnDevice, SignalsOfDensityControlAgreeWithTheCpu) {
  Fixture f;
  f.request.cull = true;
  Random random(8);
  const auto signals = [&](Device device) {
    Scene scene = f.scene;
    scene.move_to(device);
    Renderer renderer(RenderOptions{});
    const Frame& frame = renderer.forward(scene, f.request, true);
    Random noise(9);
    FrameGradient grad_frame;
    grad_frame.colour = random_tensor<float>(frame.colour.shape(), noise, -1, 1).on(device);
    SceneGradient gradient;
    gradient.reset(scene);
    Trainable trainable;
    trainable.camera = false;
    renderer.backward(scene, f.request, trainable, grad_frame, gradient);
    return gradient;
  };
  const SceneGradient expected = signals(Device::cpu), found = signals(Device::cuda);
  // The pixels at cut-offs (above) reach a few surfels each.
  EXPECT_LE(share_beyond(found.main_signal, expected.main_signal, 1e-3), 0.01);
  EXPECT_LE(share_beyond(found.environment_signal, expected.environment_signal, 1e-3), 0.01);
  int64_t seen = 0, differ = 0;
  const Tensor<uint8_t> visible = found.main_visible.on(Device::cpu);
  for (int64_t i = 0; i < visible.size(); ++i) {
    seen += expected.main_visible[i];
    differ += visible[i] != expected.main_visible[i] ? 1 : 0;
  }
  EXPECT_GT(seen, 100);
  EXPECT_LE(differ, seen / 100);
}

TEST_F(RendererOnDevice, ARendererInItsStrideAsksForNoMemory) {
  Fixture f;
  const Scene placed = on_device(f.scene);
  Renderer renderer(RenderOptions{});
  FrameGradient grad_frame;
  SceneGradient gradient;
  int64_t allocations = 0;
  for (int i = 0; i < 4; ++i) {
    const Frame& frame = renderer.forward(placed, f.request, true);
    grad_frame.colour.place(Device::cuda).reset(frame.colour.shape());
    gradient.reset(placed);
    renderer.backward(placed, f.request, Trainable{}, grad_frame, gradient);
    if (i == 1) allocations = memory::device_allocations();
  }
  EXPECT_EQ(memory::device_allocations(), allocations);
}

}  // namespace
}  // namespace traceflow

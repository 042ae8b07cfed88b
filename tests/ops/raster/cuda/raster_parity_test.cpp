#include <limits>

#include "../raster_scenes.h"
#include "ops/raster/raster.h"
#include "support/device.h"

namespace traceflow::raster {
namespace {

using namespace traceflow::testing;

class RasterOnDevice : public OnDevice, public ::testing::WithParamInterface<SortOrder> {
 protected:
  Options options() const {
    Options o;
    o.sort = GetParam();
    o.background = {0.2F, 0.5F, 0.9F};
    return o;
  }
};

struct Drawn {
  Output output;
  SavedPtr saved = make_saved();
};

void draw(const TestScene<float>& scene, const Options& options, Device device, Drawn& drawn) {
  forward(scene.surfels.on(device), scene.camera, options, drawn.output, drawn.saved.get());
}

// Single precision rounds otherwise where products are fused: 1e-4 of a layer's largest value.
constexpr double tolerance = 1e-4;

bool differs(const Tensor<float>& a, const Tensor<float>& b, int64_t pixel, double limit) {
  const int64_t channels = a.shape().rank() == 3 ? 3 : 1;
  for (int64_t c = 0; c < channels; ++c) {
    if (!(std::abs(a[channels * pixel + c] - b[channels * pixel + c]) <= limit)) return true;
  }
  return false;
}

double largest(const Tensor<float>& tensor) {
  double result = 0;
  for (const float v : tensor.values()) result = std::max(result, std::abs(static_cast<double>(v)));
  return result;
}

// Pixels at which the CPU itself gives another result when a cut-off moves by a thousandth: there a surfel's
// α stands at alpha_min or the light at its end, and rounding decides.
std::vector<bool> boundary_pixels(const TestScene<float>& scene, const Options& options, Output& expected) {
  std::vector<bool> at_boundary(static_cast<size_t>(scene.camera.width * scene.camera.height));
  for (const float factor : {0.999F, 1.001F}) {
    for (const bool light : {false, true}) {
      Options moved = options;
      (light ? moved.transmittance_min : moved.alpha_min) *= factor;
      Drawn drawn;
      draw(scene, moved, Device::cpu, drawn);
      const auto found = outputs_of(drawn.output), truth = outputs_of(expected);
      for (size_t layer = 0; layer < truth.size(); ++layer) {
        const double limit = tolerance * largest(*truth[layer]);
        for (size_t i = 0; i < at_boundary.size(); ++i) {
          if (differs(*found[layer], *truth[layer], static_cast<int64_t>(i), limit)) at_boundary[i] = true;
        }
      }
    }
  }
  return at_boundary;
}

void expect_same_pictures(const TestScene<float>& scene, const Options& options, Drawn& expected,
                          Drawn& found, std::vector<bool>& at_boundary) {
  draw(scene, options, Device::cpu, expected);
  draw(scene, options, Device::cuda, found);
  at_boundary = boundary_pixels(scene, options, expected.output);
  const auto share = static_cast<double>(std::count(at_boundary.begin(), at_boundary.end(), true)) /
                     static_cast<double>(at_boundary.size());
  EXPECT_LT(share, 0.05);
  const auto device_layers = outputs_of(found.output), layers = outputs_of(expected.output);
  for (size_t layer = 0; layer < layers.size(); ++layer) {
    const Tensor<float> on_host = device_layers[layer]->on(Device::cpu);
    ASSERT_EQ(on_host.shape(), layers[layer]->shape()) << output_names[layer];
    const double limit = tolerance * largest(*layers[layer]);
    ASSERT_GT(limit, 0) << output_names[layer];
    for (size_t i = 0; i < at_boundary.size(); ++i) {
      if (at_boundary[i]) continue;
      ASSERT_FALSE(differs(on_host, *layers[layer], static_cast<int64_t>(i), limit))
          << output_names[layer] << " at " << i << ": " << on_host[static_cast<int64_t>(i)] << " for "
          << (*layers[layer])[static_cast<int64_t>(i)];
    }
  }
}

InputGradient gradient_of(const TestScene<float>& scene, const Options& options, Device device,
                          const Drawn& drawn, const OutputGradient& grad_output) {
  OutputGradient placed;
  const auto from = outputs_of(grad_output);
  const auto to = outputs_of(placed);
  for (size_t i = 0; i < from.size(); ++i) *to[i] = from[i]->on(device);
  InputGradient gradient;
  backward(scene.surfels.on(device), scene.camera, options, *drawn.saved, placed, gradient);
  return gradient;
}

void expect_same_gradients(const TestScene<float>& scene, const Options& options, unsigned asked) {
  Drawn expected, found;
  std::vector<bool> at_boundary;
  expect_same_pictures(scene, options, expected, found, at_boundary);
  if (::testing::Test::HasFatalFailure()) return;
  OutputGradient grad_output =
      random_output_gradient<float>(7, scene.camera.width, scene.camera.height, asked);
  for (Tensor<float>* layer : outputs_of(grad_output)) {
    if (layer->empty()) continue;
    const int64_t channels = layer->shape().rank() == 3 ? 3 : 1;
    for (size_t i = 0; i < at_boundary.size(); ++i) {
      if (at_boundary[i]) std::fill_n(layer->data() + static_cast<int64_t>(i) * channels, channels, 0.0F);
    }
  }
  const InputGradient truth = gradient_of(scene, options, Device::cpu, expected, grad_output);
  const InputGradient on_device = gradient_of(scene, options, Device::cuda, found, grad_output);
  // Sums over thousands of pixels, each with its rounding, in another order.
  constexpr double gradient_tolerance = 1e-3;
  std::vector<const Tensor<float>*> groups;
  for_each_group(truth.surfels, [&](const char*, const Tensor<float>& t) { groups.push_back(&t); });
  size_t next = 0;
  for_each_group(on_device.surfels, [&](const char* name, const Tensor<float>& t) {
    expect_close_on_host(t, *groups[next++], gradient_tolerance, name);
  });
  expect_close_on_host(on_device.screen_gradient, truth.screen_gradient, gradient_tolerance,
                       "screen gradient");
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(on_device.camera.position[c], truth.camera.position[c],
                gradient_tolerance * length(truth.camera.position));
    EXPECT_LT(length(on_device.camera.camera_from_world[c] - truth.camera.camera_from_world[c]),
              gradient_tolerance * length(truth.camera.camera_from_world[c]));
  }
  Tensor<uint8_t> flags, expected_flags;
  visible(*expected.saved, expected_flags);
  visible(*found.saved, flags);
  int64_t other = 0;
  const Tensor<uint8_t> on_host = flags.on(Device::cpu);
  for (int64_t i = 0; i < on_host.size(); ++i) other += on_host[i] != expected_flags[i] ? 1 : 0;
  EXPECT_LE(other, 1 + on_host.size() / 100);
}

TestScene<float> scene_of(uint64_t seed, int width, int height, const SceneOptions& o) {
  return convert_scene<float>(random_scene(seed, width, height, o));
}

TEST_P(RasterOnDevice, AgreesWithTheCpu) {
  SceneOptions o;
  o.count = 150;
  o.scale_min = 0.03;
  o.scale_max = 0.4;
  expect_same_gradients(scene_of(1, 45, 37, o), options(), 0x1ff);
}

TEST_P(RasterOnDevice, AgreesWithTheCpuForFewerOutputs) {
  SceneOptions o;
  o.count = 60;
  o.sh_degree = 1;
  expect_same_gradients(scene_of(2, 33, 20, o), options(), 0x107);  // colour, alpha, tint, roughness
  expect_same_gradients(scene_of(3, 33, 20, o), options(), 0x11f);  // and normal and depth
}

TEST_P(RasterOnDevice, AgreesWithTheCpuWhereSurfelsReachBehindTheCamera) {
  SceneOptions o;
  o.count = 80;
  o.depth_min = -1;
  o.depth_max = 3;
  o.scale_max = 1.5;
  expect_same_gradients(scene_of(4, 40, 30, o), options(), 0x1ff);
}

TEST_P(RasterOnDevice, AgreesWithTheCpuWhereTheLowPassIsWide) {
  SceneOptions o;
  o.count = 80;
  o.scale_min = 0.005;
  o.scale_max = 0.2;
  Options blurred = options();
  blurred.low_pass = 2.5F;
  expect_same_gradients(scene_of(11, 45, 37, o), blurred, 0x1ff);
}

// More surfels in a tile than a batch holds, and pixels that end before the list does.
TEST_P(RasterOnDevice, AgreesWithTheCpuInLongLists) {
  SceneOptions o;
  o.count = 700;
  o.scale_min = 0.2;
  o.scale_max = 0.5;
  o.opacity_min = 0.02;
  o.opacity_max = 0.95;
  o.spread = 0.2;
  expect_same_gradients(scene_of(5, 20, 18, o), options(), 0x1ff);
}

// Surfels of one tile and of all of them in the same warp, in more than one warp, of which the last is not
// full.
TEST_P(RasterOnDevice, AgreesWithTheCpuForSurfelsOfManySizes) {
  expect_same_gradients(convert_scene<float>(scene_of_sizes(10, 48)), options(), 0x1ff);
}

TEST_P(RasterOnDevice, HostileSurfelsAreNotDrawn) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  SceneOptions o;
  o.count = 80;
  TestScene<float> scene = scene_of(6, 32, 32, o);
  auto& s = scene.surfels;
  s.position(0, 0) = nan;
  s.scale(5, 1) = infinity;
  s.scale(10, 0) = 0;
  s.rotation(15, 2) = nan;
  for (int k = 0; k < 4; ++k) s.rotation(20, k) = 0;  // the identity
  s.opacity[25] = nan;
  s.opacity[30] = 0;
  s.sh.row(35)[1] = nan;
  s.tint[40] = infinity;
  expect_same_gradients(scene, options(), 0x1ff);
}

TEST_P(RasterOnDevice, NothingIsTheBackground) {
  TestScene<float> scene = scene_of(7, 19, 5, SceneOptions{.count = 1});
  scene.surfels.opacity[0] = 0;
  Drawn drawn;
  draw(scene, options(), Device::cuda, drawn);
  const Tensor<float> colour = drawn.output.colour.on(Device::cpu);
  for (int64_t i = 0; i < colour.size(); ++i)
    ASSERT_EQ(colour[i], options().background[static_cast<int>(i % 3)]);
}

std::vector<Tensor<float>> gradients_on_host(const InputGradient& gradient) {
  std::vector<Tensor<float>> all{gradient.screen_gradient.on(Device::cpu)};
  for_each_group(gradient.surfels,
                 [&](const char*, const Tensor<float>& t) { all.push_back(t.on(Device::cpu)); });
  return all;
}

void expect_same_bytes(const std::vector<Tensor<float>>& a, const std::vector<Tensor<float>>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].shape(), b[i].shape()) << i;
    EXPECT_EQ(std::memcmp(a[i].data(), b[i].data(), a[i].values().size_bytes()), 0) << i;
  }
}

// Drawn twice, and from one picture two gradients with another between them.
void expect_same_bytes_every_time(const TestScene<float>& scene, const Options& options) {
  const OutputGradient grad_output =
      random_output_gradient<float>(9, scene.camera.width, scene.camera.height);
  const OutputGradient of_colour =
      random_output_gradient<float>(10, scene.camera.width, scene.camera.height, 0x01);
  std::array<Drawn, 2> drawn;
  std::array<std::vector<Tensor<float>>, 2> outputs, gradients;
  for (size_t run = 0; run < 2; ++run) {
    draw(scene, options, Device::cuda, drawn[run]);
    for (const Tensor<float>* layer : outputs_of(drawn[run].output)) {
      outputs[run].push_back(layer->on(Device::cpu));
    }
    gradients[run] = gradients_on_host(gradient_of(scene, options, Device::cuda, drawn[run], grad_output));
  }
  expect_same_bytes(outputs[0], outputs[1]);
  expect_same_bytes(gradients[0], gradients[1]);
  gradient_of(scene, options, Device::cuda, drawn[0], of_colour);
  expect_same_bytes(gradients_on_host(gradient_of(scene, options, Device::cuda, drawn[0], grad_output)),
                    gradients[0]);
}

TEST_P(RasterOnDevice, TheSameBytesEveryTime) {
  cuda::set_deterministic(true);
  SceneOptions o;
  o.count = 100;
  expect_same_bytes_every_time(scene_of(8, 40, 24, o), options());
  expect_same_bytes_every_time(convert_scene<float>(scene_of_sizes(11, 6)), options());
  cuda::set_deterministic(false);
}

INSTANTIATE_TEST_SUITE_P(Orders, RasterOnDevice, ::testing::Values(SortOrder::centre, SortOrder::hit),
                         [](const auto& order) {
                           return std::string(enum_names(order.param)[static_cast<size_t>(order.param)]);
                         });

}  // namespace
}  // namespace traceflow::raster

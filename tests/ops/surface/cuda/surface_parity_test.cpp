#include <limits>

#include "../surface_scene.h"
#include "support/device.h"

namespace traceflow::surface {
namespace {

using namespace traceflow::testing;

using SurfaceOnDevice = OnDevice;

constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

// A difference of neighbouring points is about a hundredth of a point, so that a rounding more or less in
// either point is some 1e-5 of it.
constexpr double rounding = 1e-4;

struct Scene {
  Camera<float> camera;
  Tensor<float> depth, median_depth, alpha, normal, grad_normal;
  float depth_ratio;

  Scene(int width, int height) {
    const SurfaceScene s(width, height);
    Random random(2);
    camera = convert<float>(s.camera);
    depth = convert<float>(s.depth);
    median_depth = convert<float>(s.median_depth);
    alpha = convert<float>(s.alpha);
    normal = convert<float>(s.normal);
    grad_normal = random_tensor<float>(s.normal.shape(), random, -1, 1);
    depth_ratio = static_cast<float>(s.depth_ratio);
  }
  // Numbers here and there that nothing can be made of.
  void spoil() {
    const float bad[] = {nan_f, infinity, -infinity, 0, 1e30F, -1};
    int k = 0;
    for (Tensor<float>* t : {&depth, &median_depth, &alpha, &normal, &grad_normal}) {
      for (int64_t i = 7 + k; i < t->size(); i += 61) (*t)[i] = bad[k++ % 6];
    }
  }
};

// Where a number is finite on one side, it is on the other.
void expect_agreement(const Tensor<float>& found, const Tensor<float>& expected, const char* what) {
  ASSERT_TRUE(all_finite(expected)) << what;
  bool any = false;
  for (const float v : expected.values()) any = any || v != 0;
  if (any) {
    expect_close_on_host(found, expected, rounding, what);
  } else {
    EXPECT_EQ(list_of(found.on(Device::cpu)), list_of(expected)) << what;
  }
}

struct Results {
  Tensor<float> value, grad_depth, grad_median_depth, grad_normal, origins, directions;
  CameraGradient<float> camera;
};

Results pseudo(const Scene& s, Device device, bool with_camera) {
  Results r;
  const Tensor<float> depth = s.depth.on(device), median_depth = s.median_depth.on(device),
                      alpha = s.alpha.on(device);
  pseudo_normals(s.camera, depth, median_depth, alpha, s.depth_ratio, r.value);
  r.grad_depth = Tensor<float>(depth.shape(), device);
  r.grad_median_depth = Tensor<float>(depth.shape(), device);
  pseudo_normals_backward(s.camera, depth, median_depth, alpha, s.depth_ratio, s.grad_normal.on(device),
                          r.grad_depth, r.grad_median_depth, with_camera ? &r.camera : nullptr);
  return r;
}

Results mirrored(const Scene& s, const Tensor<int32_t>& pixels, Device device, bool with_camera) {
  Results r;
  const Tensor<float> depth = s.depth.on(device), median_depth = s.median_depth.on(device),
                      normal = s.normal.on(device);
  const Tensor<int32_t> listed = pixels.on(device);
  reflection_rays(s.camera, listed, depth, median_depth, normal, s.depth_ratio, r.origins, r.directions);
  Random random(3);
  Tensor<float> grad_origins = random_tensor<float>({pixels.size(), 3}, random, -1, 1);
  const Tensor<float> grad_directions = random_tensor<float>({pixels.size(), 3}, random, -1, 1);
  if (pixels.size() > 4) grad_origins[4] = nan_f;
  r.grad_depth = Tensor<float>(depth.shape(), device);
  r.grad_median_depth = Tensor<float>(depth.shape(), device);
  r.grad_normal = Tensor<float>(normal.shape(), device);
  reflection_rays_backward(s.camera, listed, depth, median_depth, normal, s.depth_ratio,
                           grad_origins.on(device), grad_directions.on(device), r.grad_depth,
                           r.grad_median_depth, r.grad_normal, with_camera ? &r.camera : nullptr);
  return r;
}

void expect_same_camera(const CameraGradient<float>& found, const CameraGradient<float>& expected) {
  const auto joined = [](const CameraGradient<float>& g) {
    Tensor<float> all({4, 3});
    for (int c = 0; c < 3; ++c) store3(all.row(c), g.camera_from_world[c]);
    store3(all.row(3), g.position);
    return all;
  };
  // Sums of signed numbers in another order, of which those by the position cancel where only differences of
  // points count.
  expect_close(joined(found), joined(expected), 1e-4, "camera");
}

std::vector<Scene> scenes() {
  std::vector<Scene> all;
  for (const auto& [width, height] : {std::pair{1, 1}, {200, 3}, {29, 37}}) all.emplace_back(width, height);
  all.emplace_back(29, 37);
  all.back().spoil();
  return all;
}

// The pixels of a list, all of them but every fifth.
Tensor<int32_t> some_pixels(const Scene& s) {
  std::vector<int32_t> listed;
  for (int32_t i = 0; i < s.depth.size(); ++i) {
    if (i % 5 != 1) listed.push_back(i);
  }
  return tensor_of(listed);
}

TEST_F(SurfaceOnDevice, PseudoNormalsAgreeWithTheCpu) {
  for (const Scene& s : scenes()) {
    const Results expected = pseudo(s, Device::cpu, false), found = pseudo(s, Device::cuda, false);
    expect_agreement(found.value, expected.value, "normal");
    expect_agreement(found.grad_depth, expected.grad_depth, "grad_depth");
    expect_agreement(found.grad_median_depth, expected.grad_median_depth, "grad_median_depth");
  }
}

TEST_F(SurfaceOnDevice, ReflectionRaysAgreeWithTheCpu) {
  for (const Scene& s : scenes()) {
    const Tensor<int32_t> pixels = some_pixels(s);
    const Results expected = mirrored(s, pixels, Device::cpu, false),
                  found = mirrored(s, pixels, Device::cuda, false);
    expect_agreement(found.origins, expected.origins, "origins");
    expect_agreement(found.directions, expected.directions, "directions");
    expect_agreement(found.grad_depth, expected.grad_depth, "grad_depth");
    expect_agreement(found.grad_median_depth, expected.grad_median_depth, "grad_median_depth");
    expect_agreement(found.grad_normal, expected.grad_normal, "grad_normal");
  }
}

TEST_F(SurfaceOnDevice, TheCamerasGradientAgreesWithTheCpuAndDoesNotDisturbTheOthers) {
  const Scene s(29, 37);
  const Tensor<int32_t> pixels = some_pixels(s);
  const auto compare = [](const Results& found, const Results& expected, const Results& without) {
    expect_same_camera(found.camera, expected.camera);
    EXPECT_EQ(list_of(found.grad_depth.on(Device::cpu)), list_of(without.grad_depth.on(Device::cpu)));
  };
  compare(pseudo(s, Device::cuda, true), pseudo(s, Device::cpu, true), pseudo(s, Device::cuda, false));
  compare(mirrored(s, pixels, Device::cuda, true), mirrored(s, pixels, Device::cpu, true),
          mirrored(s, pixels, Device::cuda, false));
}

TEST_F(SurfaceOnDevice, SameBytesTwice) {
  const Scene s(29, 37);
  const Tensor<int32_t> pixels = some_pixels(s);
  const auto bytes = [&] {
    std::vector<std::vector<float>> all;
    for (const Results& r : {pseudo(s, Device::cuda, true), mirrored(s, pixels, Device::cuda, true)}) {
      all.push_back(list_of(r.grad_depth.on(Device::cpu)));
      for (const auto& t : camera_tensors(r.camera)) all.push_back(list_of(t));
    }
    return all;
  };
  EXPECT_EQ(bytes(), bytes());
}

TEST_F(SurfaceOnDevice, NothingTracedHasNoRays) {
  const Scene s(5, 4);
  const Results found = mirrored(s, Tensor<int32_t>(Shape{0}), Device::cuda, true);
  EXPECT_EQ(found.origins.shape(), Shape({0, 3}));
  EXPECT_EQ(found.camera.position, Vec3<float>(0));
}

// The same pixels, probes too, and the same weights.
TEST_F(SurfaceOnDevice, SelectsThePixelsThatTheCpuSelects) {
  const SelectOptions options;
  TracedPixels found;
  for (const auto& [width, height] : {std::pair{1, 1}, {200, 3}, {29, 37}, {90, 50}}) {
    Random random(4);
    Scene s(width, height);
    s.spoil();
    Tensor<float> tint = random_tensor<float>(s.alpha.shape(), random, 0, 2 * options.min_tint);
    for (int64_t i = 3; i < tint.size(); i += 41) tint[i] = nan_f;
    for (const bool probes : {false, true}) {
      const TracedPixels expected = select_pixels(s.alpha, tint, s.normal, options, probes, 9);
      select_pixels(s.alpha.on(Device::cuda), tint.on(Device::cuda), s.normal.on(Device::cuda), options,
                    probes, 9, found);
      EXPECT_EQ(list_of(found.pixel.on(Device::cpu)), list_of(expected.pixel));
      EXPECT_EQ(list_of(found.weight.on(Device::cpu)), list_of(expected.weight));
    }
  }
  select_pixels(Tensor<float>({0, 0}, Device::cuda), Tensor<float>({0, 0}, Device::cuda),
                Tensor<float>({0, 0, 3}, Device::cuda), options, true, 9, found);
  EXPECT_TRUE(found.pixel.empty());
}

}  // namespace
}  // namespace traceflow::surface

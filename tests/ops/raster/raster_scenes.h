#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "ops/raster/raster.h"

// Random scenes and losses for the tests of the rasteriser.
namespace traceflow::raster {

struct SceneOptions {
  int64_t count = 8;
  int sh_degree = 3;
  double scale_min = 0.1, scale_max = 0.6;  // scene units, log-uniform
  double depth_min = 2, depth_max = 6;      // camera z of the centres
  double spread = 0.5;  // centres reach this far from the axis, in tangents of the view angle
  double opacity_min = 0.2, opacity_max = 0.9;
  bool has_tint = true;
  bool has_bodies = true;
  bool has_roughness = true;
  bool rotated_camera = true;
};

template <class T>
struct TestScene {
  BasicPosedSurfels<T> surfels;
  Camera<T> camera;
};

// Wider than it is high, non-square pixels, principal point off centre, not at the origin.
inline Camera<double> test_camera(int width, int height, bool rotated = true) {
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  camera.focal_x = 1.1 * width;
  camera.focal_y = 1.25 * width;
  camera.centre_x = 0.46 * width;
  camera.centre_y = 0.57 * height;
  if (rotated) {
    camera.camera_from_world = rotation_from_quaternion(Vec4<double>(0.8, -0.3, 0.4, 0.2));
    camera.position = {0.7, -0.4, 1.1};
  }
  return camera;
}

inline TestScene<double> random_scene(uint64_t seed, int width, int height, const SceneOptions& o = {}) {
  Random random(seed);
  TestScene<double> scene;
  scene.camera = test_camera(width, height, o.rotated_camera);
  const int64_t k = sh_coefficients(o.sh_degree);
  auto& s = scene.surfels;
  s.position = Tensor<double>({o.count, 3});
  s.scale = Tensor<double>({o.count, 2});
  s.rotation = Tensor<double>({o.count, 4});
  s.opacity = Tensor<double>({o.count});
  s.sh = Tensor<double>({o.count, k, 3});
  if (o.has_tint) s.tint = Tensor<double>({o.count});
  if (o.has_bodies) s.in_body = Tensor<double>({o.count});
  if (o.has_roughness) s.roughness = Tensor<double>({o.count});
  for (int64_t i = 0; i < o.count; ++i) {
    const double z = random.uniform(o.depth_min, o.depth_max);
    const Vec3<double> in_camera(z * random.uniform(-o.spread, o.spread),
                                 z * random.uniform(-o.spread, o.spread), z);
    store3(s.position.row(i), in_camera * scene.camera.camera_from_world + scene.camera.position);
    for (int a = 0; a < 2; ++a) {
      s.scale(i, a) = std::exp(random.uniform(std::log(o.scale_min), std::log(o.scale_max)));
    }
    for (int a = 0; a < 4; ++a) s.rotation(i, a) = random.normal();
    s.opacity[i] = random.uniform(o.opacity_min, o.opacity_max);
    for (int64_t c = 0; c < 3 * k; ++c) s.sh.row(i)[c] = (c < 3 ? 0.8 : 0.2) * random.normal();
    if (o.has_tint) s.tint[i] = random.uniform();
    if (o.has_bodies) s.in_body[i] = i % 3 == 0 ? 1 : 0;
    // Not drawn, so that the rest of a scene is as it is without.
    if (o.has_roughness) s.roughness[i] = 0.05 + 0.07 * static_cast<double>(i % 5);
  }
  return scene;
}

// Surfels of very different sizes, in turn: in 1, 32, 33 and 104 of the 112 tiles of 16×16 pixels, along the
// image's diagonal, and in all of them. The last is the farthest.
inline constexpr std::array tiles_in_turn{1, 32, 33, 112, 104, 112};  // in their bounds
inline TestScene<double> scene_of_sizes(uint64_t seed, int64_t count) {
  struct Size {
    double x, y, half_x, half_y, turn;  // pixels, radians
  };
  constexpr std::array<Size, tiles_in_turn.size()> sizes{Size{40, 24, 4, 4, 0}, {112, 64, 28, 300, 0},
                                                         {104, 40, 82, 20, 0},  {112, 64, 130, 6, 0.52},
                                                         {120, 64, 98, 300, 0}, {112, 64, 600, 600, 0}};
  SceneOptions o;
  o.count = count;
  o.depth_max = 4;
  o.rotated_camera = false;
  TestScene<double> scene = random_scene(seed, 14 * 16, 8 * 16, o);
  Random random(seed + 1);
  auto& s = scene.surfels;
  for (int64_t i = 0; i < count; ++i) {
    const Size& size = sizes[static_cast<size_t>(i) % sizes.size()];
    const double z = i + 1 < count ? s.position(i, 2) : o.depth_max + 1;
    const Vec2<double> pixel(z / scene.camera.focal_x, z / scene.camera.focal_y);
    s.position(i, 0) = (size.x - scene.camera.centre_x) * pixel.x;
    s.position(i, 1) = (size.y - scene.camera.centre_y) * pixel.y;
    s.position(i, 2) = z;
    s.opacity[i] = random.uniform(0.1, 0.3);
    const double radius = std::sqrt(2 * std::log(255 * s.opacity[i]));
    s.scale(i, 0) = size.half_x * pixel.x / radius;
    s.scale(i, 1) = size.half_y * pixel.y / radius;
    const double tilt = 0.005;
    s.rotation(i, 0) = std::cos(size.turn / 2);
    s.rotation(i, 1) = tilt * random.normal();
    s.rotation(i, 2) = tilt * random.normal();
    s.rotation(i, 3) = std::sin(size.turn / 2);
  }
  return scene;
}

template <class To, class From>
TestScene<To> convert_scene(const TestScene<From>& scene) {
  return {convert<To>(scene.surfels), convert<To>(scene.camera)};
}

// The outputs by their place, for loops over all of them.
template <class Output>
auto outputs_of(Output& o) {
  return std::array{&o.colour,       &o.alpha,      &o.tint,       &o.normal,   &o.depth,
                    &o.median_depth, &o.distortion, &o.silhouette, &o.roughness};
}
inline constexpr std::array output_names{"colour",       "alpha",      "tint",       "normal",   "depth",
                                         "median_depth", "distortion", "silhouette", "roughness"};

// A linear loss Σ g·output with random g for the outputs named by `mask` (bit i: output i), absent for the
// others.
template <class T>
BasicOutputGradient<T> random_output_gradient(uint64_t seed, int width, int height, unsigned mask = 0x1ff) {
  Random random(seed);
  BasicOutputGradient<T> g;
  const auto tensors = outputs_of(g);
  for (size_t i = 0; i < tensors.size(); ++i) {
    if (!(mask >> i & 1U)) continue;
    const bool is_vector = i == 0 || i == 3;
    *tensors[i] = is_vector ? Tensor<T>({height, width, 3}) : Tensor<T>({height, width});
    for (T& v : tensors[i]->values()) v = static_cast<T>(random.normal());
  }
  return g;
}

// The groups of a surfel's values that have gradients (or these gradients) by name.
template <class Surfels, class F>
void for_each_group(Surfels& s, F&& f) {
  f("position", s.position);
  f("scale", s.scale);
  f("rotation", s.rotation);
  f("opacity", s.opacity);
  f("sh", s.sh);
  f("tint", s.tint);
  f("roughness", s.roughness);
}
// And the others.
template <class Surfels, class F>
void for_each_input(Surfels& s, F&& f) {
  for_each_group(s, f);
  f("in_body", s.in_body);
}

}  // namespace traceflow::raster

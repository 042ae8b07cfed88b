#pragma once

#include <cmath>
#include <vector>

#include "base/random.h"
#include "math/spherical_harmonics.h"
#include "ops/trace/trace.h"

// Random surfels and rays for the tests of the tracer.
namespace traceflow::trace {

struct SceneOptions {
  int64_t surfels = 40;
  int64_t rays = 30;
  int sh_degree = 3;
  double scale_min = 0.2, scale_max = 0.6;
  double opacity_min = 0.1, opacity_max = 0.9;
  double box = 1;           // surfels lie in [-box, box]³
  double ray_distance = 3;  // rays start on a sphere of this radius and aim into the box
  double width_max = 0;     // of the rays' cones, where they are any
};

struct TestScene {
  PosedSurfels surfels;
  Rays rays;
};

inline void fill_surfel(PosedSurfels& s, int64_t i, Random& random, const SceneOptions& options) {
  for (int k = 0; k < 3; ++k) {
    s.position(i, k) = static_cast<float>(random.uniform(-options.box, options.box));
  }
  for (int k = 0; k < 2; ++k) {
    s.scale(i, k) = static_cast<float>(random.uniform(options.scale_min, options.scale_max));
  }
  for (int k = 0; k < 4; ++k) s.rotation(i, k) = static_cast<float>(random.normal());
  s.opacity[i] = static_cast<float>(random.uniform(options.opacity_min, options.opacity_max));
  for (int64_t k = 0; k < s.sh.row_size(); ++k) s.sh.row(i)[k] = static_cast<float>(0.2 * random.normal());
}

inline PosedSurfels make_surfels(int64_t count, int sh_degree) {
  PosedSurfels s;
  s.position = Tensor<float>({count, 3});
  s.scale = Tensor<float>({count, 2});
  s.rotation = Tensor<float>({count, 4});
  s.opacity = Tensor<float>({count});
  s.sh = Tensor<float>({count, sh_coefficients(sh_degree), 3});
  return s;
}

// To be filled in: all zeros.
inline TestScene blank_scene(int64_t surfels, int sh_degree, int64_t rays) {
  return {make_surfels(surfels, sh_degree), {Tensor<float>({rays, 3}), Tensor<float>({rays, 3})}};
}

inline Vec3<double> random_direction(Random& random) {
  // One after the other: compilers evaluate arguments in orders of their own.
  const double z = random.normal(), y = random.normal(), x = random.normal();
  return glm::normalize(Vec3<double>(x, y, z));
}

inline TestScene random_scene(uint64_t seed, const SceneOptions& options = {}) {
  Random random(seed);
  TestScene scene = blank_scene(options.surfels, options.sh_degree, options.rays);
  for (int64_t i = 0; i < options.surfels; ++i) fill_surfel(scene.surfels, i, random, options);
  for (int64_t r = 0; r < options.rays; ++r) {
    const Vec3<double> origin = options.ray_distance * random_direction(random);
    const Vec3<double> target = 0.6 * options.box * random_direction(random);
    store3(scene.rays.origins.row(r), origin);
    store3(scene.rays.directions.row(r), random.uniform(0.5, 2) * glm::normalize(target - origin));
  }
  if (options.width_max > 0) {
    scene.rays.widths = Tensor<float>({options.rays});
    for (float& width : scene.rays.widths.values())
      width = static_cast<float>(random.uniform(0, options.width_max));
  }
  return scene;
}

// One upright surfel at z = depth, facing the ray along +z.
inline void set_facing(PosedSurfels& s, int64_t i, float depth, float scale, float opacity) {
  s.position(i, 0) = s.position(i, 1) = 0;
  s.position(i, 2) = depth;
  s.scale(i, 0) = s.scale(i, 1) = scale;
  s.rotation(i, 0) = 1;
  s.rotation(i, 1) = s.rotation(i, 2) = s.rotation(i, 3) = 0;
  s.opacity[i] = opacity;
}

inline BasicOutputGradient<double> random_output_gradient(uint64_t seed, int64_t rays) {
  Random random(seed);
  BasicOutputGradient<double> g{Tensor<double>({rays, 3}), Tensor<double>({rays}), Tensor<double>({rays})};
  for (double& v : g.colour.values()) v = random.normal();
  for (double& v : g.alpha.values()) v = random.normal();
  for (double& v : g.distance.values()) v = random.normal();
  return g;
}

inline OutputGradient to_float(const BasicOutputGradient<double>& g) {
  return {convert<float>(g.colour), convert<float>(g.alpha), convert<float>(g.distance)};
}

}  // namespace traceflow::trace

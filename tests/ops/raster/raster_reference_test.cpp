#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <ostream>

#include "raster_scenes.h"

namespace traceflow::raster {
namespace {

constexpr int small_width = 7;
constexpr int small_height = 6;

double loss(const TestScene<double>& scene, const Options& options,
            const BasicOutputGradient<double>& weights) {
  BasicOutput<double> output;
  forward_reference(scene.surfels, scene.camera, options, output);
  const auto values = outputs_of(output);
  const auto factors = outputs_of(weights);
  double sum = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    if (values[i]->empty()) continue;
    for (int64_t j = 0; j < factors[i]->size(); ++j) sum += (*values[i])[j] * (*factors[i])[j];
  }
  return sum;
}

double central_difference(TestScene<double>& scene, double& parameter, const Options& options,
                          const BasicOutputGradient<double>& weights) {
  constexpr double step = 1e-6;
  const double kept = parameter;
  parameter = kept + step;
  const double above = loss(scene, options, weights);
  parameter = kept - step;
  const double below = loss(scene, options, weights);
  parameter = kept;
  return (above - below) / (2 * step);
}

void expect_gradient(TestScene<double> scene, const Options& options,
                     const BasicOutputGradient<double>& weights) {
  BasicInputGradient<double> gradient;
  backward_reference(scene.surfels, scene.camera, options, weights, gradient);
  std::vector<const Tensor<double>*> analytic;
  for_each_group(gradient.surfels, [&](const char*, const Tensor<double>& g) { analytic.push_back(&g); });
  const auto expect_close = [&](double found, double expected, const std::string& what) {
    EXPECT_NEAR(found, expected, 2e-6 * (1 + std::abs(expected))) << what;
  };
  size_t group = 0;
  for_each_group(scene.surfels, [&](const char* name, Tensor<double>& values) {
    for (int64_t i = 0; i < values.size(); ++i) {
      expect_close((*analytic[group])[i], central_difference(scene, values[i], options, weights),
                   name + std::to_string(i));
    }
    ++group;
  });
  for (int a = 0; a < 3; ++a) {
    expect_close(gradient.camera.position[a],
                 central_difference(scene, scene.camera.position[a], options, weights), "camera position");
    for (int b = 0; b < 3; ++b) {
      expect_close(gradient.camera.camera_from_world[a][b],
                   central_difference(scene, scene.camera.camera_from_world[a][b], options, weights),
                   "camera rotation");
    }
  }
}

struct GradientCase {
  const char* name;
  Options options;
  SceneOptions scene;

  friend std::ostream& operator<<(std::ostream& to, const GradientCase& c) { return to << c.name; }
};

std::vector<GradientCase> gradient_cases() {
  Options centre;
  centre.background = {0.3F, 0.6F, 0.1F};
  centre.far_plane = 20;
  Options hit = centre;
  hit.sort = SortOrder::hit;
  Options sharp = centre;
  sharp.low_pass = 0;
  Options blurred = centre;
  blurred.low_pass = 2.5F;
  SceneOptions wide;
  SceneOptions small;  // the low-pass wins
  small.scale_min = 0.005;
  small.scale_max = 0.3;
  small.count = 20;
  SceneOptions dense;  // pixels end early, alphas are clamped
  dense.count = 24;
  dense.opacity_min = 0.9;
  dense.opacity_max = 1.3;
  dense.sh_degree = 1;
  SceneOptions bare;
  bare.has_tint = bare.has_bodies = bare.has_roughness = false;
  bare.sh_degree = 0;
  SceneOptions near;  // centres on both sides of the near plane, surfels that reach behind the camera
  near.depth_min = -0.5;
  near.depth_max = 1;
  near.count = 16;
  return {{"wide", centre, wide},    {"wide_hit", hit, wide},     {"small", centre, small},
          {"small_hit", hit, small}, {"dense", centre, dense},    {"dense_hit", hit, dense},
          {"sharp", sharp, small},   {"blurred", blurred, small}, {"bare", centre, bare},
          {"near", centre, near},    {"near_hit", hit, near}};
}

class ReferenceGradient : public ::testing::TestWithParam<GradientCase> {};

TEST_P(ReferenceGradient, matches_central_differences_of_all_outputs_at_once) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    expect_gradient(random_scene(seed, small_width, small_height, GetParam().scene), GetParam().options,
                    random_output_gradient<double>(seed + 100, small_width, small_height));
  }
}

TEST_P(ReferenceGradient, matches_central_differences_of_each_output) {
  for (unsigned output = 0; output < output_names.size(); ++output) {
    SCOPED_TRACE(output_names[output]);
    expect_gradient(random_scene(7, small_width, small_height, GetParam().scene), GetParam().options,
                    random_output_gradient<double>(8, small_width, small_height, 1U << output));
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, ReferenceGradient, ::testing::ValuesIn(gradient_cases()),
                         [](const auto& test) { return test.param.name; });

// One surfel that faces a camera at the origin, its centre on the ray through the pixel (2, 1).
TestScene<double> one_surfel(double scale, double opacity) {
  SceneOptions o;
  o.count = 1;
  o.sh_degree = 0;
  TestScene<double> scene = random_scene(1, 5, 3, o);
  scene.camera = {5, 3, 10, 8, 2.5, 1.5, Mat3<double>(1.0), Vec3<double>(0.0)};
  auto& s = scene.surfels;
  store3(s.position.row(0), Vec3<double>(0, 0, 4));
  s.rotation(0, 0) = 1;
  s.rotation(0, 1) = s.rotation(0, 2) = s.rotation(0, 3) = 0;
  s.scale(0, 0) = scale;
  s.scale(0, 1) = 2 * scale;
  s.opacity[0] = opacity;
  s.tint[0] = 0.25;
  store3(s.sh.row(0), Vec3<double>(1, 0, -3));
  return scene;
}

TEST(RasterReference, draws_one_surfel_as_the_formulas_say) {
  Options options;
  options.background = {0.5F, 0.25F, 0.125F};
  const auto scene = one_surfel(0.8, 0.6);
  BasicOutput<double> out;
  forward_reference(scene.surfels, scene.camera, options, out);
  // The pixel (4, 2) lies 2 pixels right and 1 below the centre: (0.8, 0.5) in the plane.
  const double gaussian = std::exp(-0.5 * (std::pow(0.8 / 0.8, 2) + std::pow(0.5 / 1.6, 2)));
  const double w = 0.6 * gaussian;
  EXPECT_NEAR(out.alpha(2, 4), w, 1e-12);
  EXPECT_NEAR(out.colour(2, 4, 0), w * (0.5 + sh_c0) + (1 - w) * 0.5, 1e-12);
  EXPECT_NEAR(out.colour(2, 4, 1), w * 0.5 + (1 - w) * 0.25, 1e-12);
  EXPECT_NEAR(out.colour(2, 4, 2), (1 - w) * 0.125, 1e-12);
  EXPECT_NEAR(out.tint(2, 4), 0.25 * w, 1e-12);
  EXPECT_NEAR(out.normal(2, 4, 2), -w, 1e-12);
  EXPECT_NEAR(out.depth(2, 4), 4, 1e-12);
  EXPECT_EQ(out.median_depth(2, 4), 0);  // w < 0.5: the transmittance never crosses one half
  EXPECT_NEAR(out.median_depth(1, 2), 4, 1e-12);
  EXPECT_EQ(out.distortion(2, 4), 0);
}

TEST(RasterReference, low_pass_keeps_a_surfel_smaller_than_a_pixel) {
  Options options;
  const auto scene = one_surfel(1e-6, 0.6);
  BasicOutput<double> out;
  forward_reference(scene.surfels, scene.camera, options, out);
  EXPECT_NEAR(out.alpha(1, 3), 0.6 * std::exp(-1.0), 1e-12);
  EXPECT_NEAR(out.alpha(2, 3), 0.6 * std::exp(-2.0), 1e-12);
  options.low_pass = 2;
  forward_reference(scene.surfels, scene.camera, options, out);
  EXPECT_NEAR(out.alpha(1, 3), 0.6 * std::exp(-0.25), 1e-12) << "twice as wide";
  options.low_pass = 0;
  forward_reference(scene.surfels, scene.camera, options, out);
  EXPECT_EQ(out.alpha(1, 3), 0);
}

TEST(RasterReference, distortion_is_the_weighted_sum_over_pairs) {
  SceneOptions o;
  o.count = 2;
  auto scene = one_surfel(100, 0.6);
  TestScene<double> two = random_scene(1, 5, 3, o);
  two.camera = scene.camera;
  for (int i = 0; i < 2; ++i) {
    store3(two.surfels.position.row(i), Vec3<double>(0, 0, 2 + 3 * i));
    two.surfels.rotation(i, 0) = 1;
    two.surfels.rotation(i, 1) = two.surfels.rotation(i, 2) = two.surfels.rotation(i, 3) = 0;
    two.surfels.scale(i, 0) = two.surfels.scale(i, 1) = 100;
    two.surfels.opacity[i] = 0.5;
  }
  Options options;
  options.near_plane = 1;
  options.far_plane = 11;
  BasicOutput<double> out;
  forward_reference(two.surfels, two.camera, options, out);
  const double difference = 1.1 * (1.0 / 2 - 1.0 / 5);
  EXPECT_NEAR(out.distortion(1, 2), 0.5 * 0.25 * difference * difference, 1e-4 * out.distortion(1, 2));
  EXPECT_NEAR(out.depth(1, 2), (0.5 * 2 + 0.25 * 5) / 0.75, 1e-12);
}

}  // namespace
}  // namespace traceflow::raster

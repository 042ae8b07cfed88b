#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "ops/trace/trace.h"
#include "ops/trace/trace_scene.h"

namespace traceflow::trace {
namespace {

struct Problem {
  BasicPosedSurfels<double> surfels;
  BasicRays<double> rays;
  Options options;
};

Problem make_problem(uint64_t seed, const SceneOptions& scene_options) {
  const TestScene scene = random_scene(seed, scene_options);
  Problem p{convert<double>(scene.surfels), convert<double>(scene.rays), {}};
  // The cut-off at alpha_min is a step in the image: far enough down, differences do not meet it.
  p.options.alpha_min = 1e-12F;
  p.options.transmittance_min = 0;
  p.options.background = {0.3F, 0.5F, 0.2F};
  return p;
}

double loss(const Problem& p, const BasicOutputGradient<double>& weights) {
  BasicOutput<double> out;
  forward_reference(p.surfels, p.rays, p.options, out);
  double sum = 0;
  for (int64_t i = 0; i < out.colour.size(); ++i) sum += weights.colour[i] * out.colour[i];
  for (int64_t i = 0; i < out.alpha.size(); ++i) sum += weights.alpha[i] * out.alpha[i];
  for (int64_t i = 0; i < out.distance.size(); ++i) sum += weights.distance[i] * out.distance[i];
  return sum;
}

void expect_matches_differences(Problem& p, Tensor<double>& values, const Tensor<double>& gradient,
                                const BasicOutputGradient<double>& weights, const std::string& name) {
  const double step = 1e-6;
  const int64_t stride = std::max<int64_t>(1, values.size() / 60);
  double largest = 0;
  for (const double g : gradient.values()) largest = std::max(largest, std::abs(g));
  ASSERT_GT(largest, 0) << name;
  for (int64_t i = 0; i < values.size(); i += stride) {
    const double kept = values[i];
    values[i] = kept + step;
    const double above = loss(p, weights);
    values[i] = kept - step;
    const double below = loss(p, weights);
    values[i] = kept;
    EXPECT_NEAR(gradient[i], (above - below) / (2 * step), 1e-6 * largest + 1e-7) << name << " " << i;
  }
}

void expect_all_gradients(Problem p, uint64_t seed) {
  const BasicOutputGradient<double> weights = random_output_gradient(seed, p.rays.count());
  BasicInputGradient<double> g;
  backward_reference(p.surfels, p.rays, p.options, weights, g);
  expect_matches_differences(p, p.surfels.position, g.surfels.position, weights, "position");
  expect_matches_differences(p, p.surfels.scale, g.surfels.scale, weights, "scale");
  expect_matches_differences(p, p.surfels.rotation, g.surfels.rotation, weights, "rotation");
  expect_matches_differences(p, p.surfels.opacity, g.surfels.opacity, weights, "opacity");
  expect_matches_differences(p, p.surfels.sh, g.surfels.sh, weights, "sh");
  expect_matches_differences(p, p.rays.origins, g.rays.origins, weights, "origins");
  expect_matches_differences(p, p.rays.directions, g.rays.directions, weights, "directions");
  if (!p.rays.widths.empty()) expect_matches_differences(p, p.rays.widths, g.rays.widths, weights, "widths");
}

// Few, wide, faint surfels: every ray meets each far from where a hit would come or go.
SceneOptions smooth_scene(int degree) {
  return {.surfels = 6, .rays = 5, .sh_degree = degree, .scale_min = 0.9, .scale_max = 1.5, .box = 0.5};
}

TEST(TraceReference, GradientsMatchCentralDifferencesAtEveryDegree) {
  for (int degree = 0; degree <= 3; ++degree) {
    SCOPED_TRACE("degree " + std::to_string(degree));
    expect_all_gradients(make_problem(7 + static_cast<uint64_t>(degree), smooth_scene(degree)), 100);
  }
}

TEST(TraceReference, GradientsOfConesMatchCentralDifferences) {
  SceneOptions o = smooth_scene(2);
  o.width_max = 0.3;
  expect_all_gradients(make_problem(12, o), 101);
}

// What a cone sees of one surfel is the mean of what its rays see: over directions (x, y, 1), with x and y
// from a Gaussian of the cone's width, by Simpson's rule.
TEST(TraceReference, AConeSeesTheMeanOfItsRays) {
  constexpr int steps = 200;
  constexpr double width = 0.2, reach = 7;
  PosedSurfels s = make_surfels(1, 0);
  set_facing(s, 0, 2, 0.5F, 0.8F);
  s.scale(0, 1) = 0.1F;
  const BasicPosedSurfels<double> surfels = convert<double>(s);
  Options options;
  options.alpha_min = 1e-30F;
  BasicRays<double> rays{Tensor<double>({(steps + 1) * (steps + 1), 3}), {}};
  rays.directions = Tensor<double>(rays.origins.shape());
  for (int64_t r = 0; r < rays.count(); ++r) {
    rays.origins(r, 0) = 0.3;
    rays.directions(r, 0) = width * reach * (2 * static_cast<double>(r % (steps + 1)) / steps - 1);
    rays.directions(r, 1) = width * reach * (2 * static_cast<double>(r / (steps + 1)) / steps - 1);
    rays.directions(r, 2) = 1;
  }
  BasicOutput<double> each;
  forward_reference(surfels, rays, options, each);
  const auto weight = [](int64_t i) { return i == 0 || i == steps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0; };
  double mean = 0, sum = 0;
  for (int64_t r = 0; r < rays.count(); ++r) {
    const double x = rays.directions(r, 0) / width, y = rays.directions(r, 1) / width;
    const double w = weight(r % (steps + 1)) * weight(r / (steps + 1)) * std::exp(-0.5 * (x * x + y * y));
    mean += w * each.alpha[r];
    sum += w;
  }
  BasicRays<double> cone{Tensor<double>({1, 3}), Tensor<double>({1, 3}), Tensor<double>({1})};
  cone.origins(0, 0) = 0.3;
  cone.directions(0, 2) = 3;
  cone.widths[0] = width;
  BasicOutput<double> found;
  forward_reference(surfels, cone, options, found);
  EXPECT_NEAR(found.alpha[0], mean / sum, 1e-6);
  EXPECT_LT(found.alpha[0], 0.5 * each.alpha[rays.count() / 2]) << "the cone is no mere ray";
}

TEST(TraceReference, GradientOfAClampedAlphaIsZero) {
  Problem p = make_problem(3, smooth_scene(0));
  p.options.alpha_max = 0.2F;
  expect_all_gradients(p, 4);
}

TEST(TraceReference, OneFacingSurfelIsWhatTheFormulaSays) {
  PosedSurfels s = make_surfels(1, 0);
  set_facing(s, 0, 2, 0.5F, 0.8F);
  for (int c = 0; c < 3; ++c) s.sh.row(0)[c] = static_cast<float>(0.1 * (c + 1) / sh_c0);
  BasicRays<double> rays{Tensor<double>({1, 3}), Tensor<double>({1, 3})};
  rays.origins(0, 0) = 0.25;
  rays.directions(0, 2) = 4;
  BasicOutput<double> out;
  Options options;
  options.background = {1, 0, 0};
  forward_reference(convert<double>(s), rays, options, out);
  const double alpha = 0.8 * std::exp(-0.125);
  EXPECT_NEAR(out.alpha[0], alpha, 1e-7);
  EXPECT_NEAR(out.distance[0], 0.5, 1e-12);
  EXPECT_NEAR(out.colour(0, 0), alpha * 0.6 + (1 - alpha), 1e-7);
  EXPECT_NEAR(out.colour(0, 1), alpha * 0.7, 1e-7);
  EXPECT_NEAR(out.colour(0, 2), alpha * 0.8, 1e-7);
}

TEST(TraceReference, BlendsByDistanceWhateverTheOrderOfTheSurfels) {
  PosedSurfels s = make_surfels(3, 0);
  const float depth[3] = {3, 1, 2};
  for (int64_t i = 0; i < 3; ++i) {
    set_facing(s, i, depth[i], 1, 0.5F);
    for (int c = 0; c < 3; ++c) s.sh.row(i)[c] = static_cast<float>((c == i ? 0.5 : -0.5) / sh_c0);
  }
  BasicRays<double> rays{Tensor<double>({1, 3}), Tensor<double>({1, 3})};
  rays.directions(0, 2) = 1;
  BasicOutput<double> out;
  forward_reference(convert<double>(s), rays, {}, out);
  EXPECT_NEAR(out.colour(0, 1), 0.5, 1e-7);
  EXPECT_NEAR(out.colour(0, 2), 0.25, 1e-7);
  EXPECT_NEAR(out.colour(0, 0), 0.125, 1e-7);
  EXPECT_NEAR(out.distance[0], (0.5 * 1 + 0.25 * 2 + 0.125 * 3) / 0.875, 1e-12);
}

TEST(TraceReference, EndsBeforeTheTransmittanceFallsUnderTheMinimum) {
  PosedSurfels s = make_surfels(4, 0);
  for (int64_t i = 0; i < 4; ++i) set_facing(s, i, static_cast<float>(i + 1), 1, 0.95F);
  BasicRays<double> rays{Tensor<double>({1, 3}), Tensor<double>({1, 3})};
  rays.directions(0, 2) = 1;
  BasicOutput<double> out;
  forward_reference(convert<double>(s), rays, {}, out);
  EXPECT_NEAR(out.alpha[0], 1 - 0.05 * 0.05 * 0.05, 1e-7);  // a fourth hit would leave 6e-6
}

TEST(TraceReference, IgnoresHitsNearerThanTheMinimum) {
  PosedSurfels s = make_surfels(2, 0);
  set_facing(s, 0, 0.01F, 1, 0.5F);
  set_facing(s, 1, 1, 1, 0.25F);
  BasicRays<double> rays{Tensor<double>({1, 3}), Tensor<double>({1, 3})};
  rays.directions(0, 2) = 10;
  Options options;
  options.t_min = 0.02F;
  BasicOutput<double> out;
  forward_reference(convert<double>(s), rays, options, out);
  EXPECT_NEAR(out.alpha[0], 0.25, 1e-7);
}

}  // namespace
}  // namespace traceflow::trace

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <numeric>

#include "base/parallel.h"
#include "ops/trace/trace.h"
#include "ops/trace/trace_run.h"
#include "ops/trace/trace_scene.h"

namespace traceflow::trace {
namespace {

// How many of a tensor's numbers are farther than `tolerance` from those of the reference.
int64_t count_far(const Tensor<float>& fast, const Tensor<double>& truth, double tolerance) {
  EXPECT_EQ(fast.size(), truth.size());
  int64_t far = 0;
  for (int64_t i = 0; i < fast.size(); ++i) far += !(std::abs(fast[i] - truth[i]) <= tolerance);
  return far;
}

double root_mean_square(const Tensor<double>& t) {
  double sum = 0;
  for (const double v : t.values()) sum += v * v;
  return std::sqrt(sum / static_cast<double>(std::max<int64_t>(1, t.size())));
}

// A hit near alpha_min or two hits at almost one distance may fall either way in single precision: a bounded
// share.
void expect_output_near(const Output& fast, const BasicOutput<double>& truth, double flips) {
  const double rays = static_cast<double>(fast.alpha.size());
  EXPECT_LE(count_far(fast.colour, truth.colour, 2e-4), 3 * flips * rays);
  EXPECT_LE(count_far(fast.alpha, truth.alpha, 2e-4), flips * rays);
  EXPECT_LE(count_far(fast.distance, truth.distance, 2e-3), flips * rays);
}

void expect_matches_reference(const TestScene& scene, const Options& options, double flips) {
  const Traced fast = trace(scene, options);
  const auto surfels = convert<double>(scene.surfels);
  BasicOutput<double> truth;
  forward_reference(surfels, convert<double>(scene.rays), options, truth);
  expect_output_near(fast.output, truth, flips);
}

TEST(Trace, MatchesTheReferenceAtEveryDegree) {
  for (int degree = 0; degree <= 3; ++degree) {
    const SceneOptions o{
        .surfels = 2000, .rays = 700, .sh_degree = degree, .scale_min = 0.02, .scale_max = 0.2};
    expect_matches_reference(random_scene(static_cast<uint64_t>(degree), o), {}, 0.01);
  }
}

TEST(Trace, MatchesTheReferenceWithCones) {
  for (const double width : {0.01, 0.1, 1.0}) {
    const SceneOptions o{
        .surfels = 2000, .rays = 700, .scale_min = 0.02, .scale_max = 0.2, .width_max = width};
    expect_matches_reference(random_scene(13, o), {}, 0.01);
  }
}

TEST(Trace, MatchesTheReferenceWhereEveryRayEndsEarly) {
  const SceneOptions o{.surfels = 3000,
                       .rays = 500,
                       .scale_min = 0.05,
                       .scale_max = 0.3,
                       .opacity_min = 0.9,
                       .opacity_max = 1.0};
  Options options;
  options.hits_per_pass = 2;
  options.background = {0.1F, 0.2F, 0.3F};
  expect_matches_reference(random_scene(11, o), options, 0.01);
}

TEST(Trace, MatchesTheReferenceFromInsideTheScene) {
  const SceneOptions o{.surfels = 1000, .rays = 500, .scale_min = 0.05, .ray_distance = 0.3};
  Options options;
  options.t_min = 0.1F;
  expect_matches_reference(random_scene(12, o), options, 0.01);
}

// Faint, wide surfels, few enough that no two bright hits of a ray come at almost one distance, and a far
// cut-off: nothing flips, so that gradients agree everywhere.
TEST(Trace, GradientsMatchTheReference) {
  for (const auto& [degree, width] : {std::pair{0, 0.0}, {1, 0.0}, {2, 0.0}, {3, 0.0}, {1, 0.1}, {3, 0.2}}) {
    const SceneOptions o{
        .surfels = 150, .rays = 700, .sh_degree = degree, .opacity_max = 0.6, .width_max = width};
    const TestScene scene = random_scene(20 + static_cast<uint64_t>(degree), o);
    Options options;
    options.alpha_min = 1e-9F;
    options.background = {0.4F, 0.1F, 0.2F};
    const Traced fast = trace(scene, options, 5);
    BasicInputGradient<double> truth;
    backward_reference(convert<double>(scene.surfels), convert<double>(scene.rays), options,
                       random_output_gradient(5, scene.rays.count()), truth);
    const auto expect_near = [&](const Tensor<float>& a, const Tensor<double>& b, const char* name) {
      EXPECT_EQ(count_far(a, b, 5e-3 * root_mean_square(b)), 0) << name << " degree " << degree;
    };
    expect_near(fast.gradient.surfels.position, truth.surfels.position, "position");
    expect_near(fast.gradient.surfels.scale, truth.surfels.scale, "scale");
    expect_near(fast.gradient.surfels.rotation, truth.surfels.rotation, "rotation");
    expect_near(fast.gradient.surfels.opacity, truth.surfels.opacity, "opacity");
    expect_near(fast.gradient.surfels.sh, truth.surfels.sh, "sh");
    expect_near(fast.gradient.rays.origins, truth.rays.origins, "origins");
    expect_near(fast.gradient.rays.directions, truth.rays.directions, "directions");
    expect_near(fast.gradient.rays.widths, truth.rays.widths, "widths");
  }
}

TEST(Trace, PositionGradientIsTheNormTimesHalfTheDistance) {
  TestScene scene = blank_scene(1, 0, 1);
  set_facing(scene.surfels, 0, 2, 0.5F, 0.8F);
  scene.rays.origins(0, 0) = 0.3F;
  scene.rays.directions(0, 2) = 4;
  const Traced t = trace(scene, {});
  const Vec3<float> g = load3<float>(t.gradient.surfels.position.row(0));
  EXPECT_GT(glm::length(g), 0);
  EXPECT_NEAR(t.gradient.position_gradient[0], glm::length(g) * 2 / 2, 1e-6);
}

// The scene's first rays with one weight for all, whichever are traced.
Traced traced_alike(TestScene scene, int64_t first, int64_t count) {
  Rays rays{Tensor<float>({count, 3}), Tensor<float>({count, 3})};
  std::copy_n(scene.rays.origins.row(first), 3 * count, rays.origins.data());
  std::copy_n(scene.rays.directions.row(first), 3 * count, rays.directions.data());
  const BvhPtr bvh = make_bvh();
  const SavedPtr saved = make_saved();
  Traced result;
  build(scene.surfels, {}, *bvh);
  forward(scene.surfels, *bvh, rays, {}, result.output, saved.get());
  OutputGradient weights;
  weights.colour.reset({count, 3});
  weights.colour.fill(0.7F);
  backward(scene.surfels, rays, {}, *saved, weights, result.gradient);
  return result;
}

// Rays through both sides of a disk: their gradients are added before their length is taken.
TEST(Trace, PositionGradientOfManyHitsIsTheNormOfTheirSum) {
  constexpr int64_t rays = 8;
  TestScene scene = blank_scene(1, 0, rays);
  set_facing(scene.surfels, 0, 2, 0.5F, 0.8F);
  for (int64_t ray = 0; ray < rays; ++ray) {
    scene.rays.origins(ray, 0) = 0.2F * static_cast<float>(ray) - 0.7F;
    scene.rays.origins(ray, 1) = 0.1F;
    scene.rays.directions(ray, 0) = 0.05F * static_cast<float>(ray);
    scene.rays.directions(ray, 2) = 1;
  }
  Vec3<float> sum(0);
  float norms = 0;
  for (int64_t ray = 0; ray < rays; ++ray) {
    const Traced one = traced_alike(scene, ray, 1);
    const float t = one.output.distance[0] * glm::length(load3<float>(scene.rays.directions.row(ray)));
    sum += 0.5F * t * load3<float>(one.gradient.surfels.position.row(0));
    norms += one.gradient.position_gradient[0];
  }
  const float found = traced_alike(scene, 0, rays).gradient.position_gradient[0];
  EXPECT_NEAR(found, glm::length(sum), 1e-4F * norms);
  EXPECT_GT(norms, 1.5F * found) << "some of them cancel";
}

TEST(Trace, HitsPerPassChangesNothing) {
  SceneOptions o{.surfels = 3000, .rays = 600, .scale_max = 0.3};
  for (const double opacity : {0.3, 0.99}) {
    o.opacity_max = opacity;
    const TestScene scene = random_scene(31, o);
    Options options;
    options.hits_per_pass = 1;
    const Traced one = trace(scene, options);
    for (const int k : {4, 64, 100000}) {
      options.hits_per_pass = k;
      const Traced other = trace(scene, options);
      EXPECT_TRUE(same_bytes(one.output, other.output)) << k;
      EXPECT_TRUE(same_bytes(one.gradient, other.gradient)) << k;
    }
  }
}

TEST(Trace, SameBytesAtAnyNumberOfThreads) {
  const SceneOptions o{.surfels = 40000, .rays = 3000, .scale_min = 0.02, .scale_max = 0.1};
  const TestScene scene = random_scene(41, o);
  set_threads(1);
  const Traced one = trace(scene, {});
  for (const int threads : {2, 3}) {
    set_threads(threads);
    const Traced other = trace(scene, {});
    EXPECT_TRUE(same_bytes(one.output, other.output)) << threads;
    EXPECT_TRUE(same_bytes(one.gradient, other.gradient)) << threads;
  }
  set_threads(0);
}

template <class T>
Tensor<T> permuted(const Tensor<T>& from, const std::vector<int64_t>& order) {
  Tensor<T> to(from.shape());
  for (size_t i = 0; i < order.size(); ++i) {
    std::copy_n(from.row(order[i]), from.row_size(), to.row(static_cast<int64_t>(i)));
  }
  return to;
}

void expect_near(const Tensor<float>& a, const Tensor<float>& b, double tolerance) {
  EXPECT_EQ(count_far(a, convert<double>(b), tolerance), 0);
}

TEST(Trace, TheOrderOfTheSurfelsDoesNotMatter) {
  const SceneOptions o{.surfels = 2000, .rays = 500};
  const TestScene scene = random_scene(51, o);
  std::vector<int64_t> order(static_cast<size_t>(o.surfels));
  std::iota(order.begin(), order.end(), 0);
  Random random(9);
  for (size_t i = order.size(); i-- > 1;) {
    std::swap(order[i], order[static_cast<size_t>(random.below(static_cast<int64_t>(i) + 1))]);
  }
  const PosedSurfels& s = scene.surfels;
  const TestScene shuffled{{permuted(s.position, order),
                            permuted(s.scale, order),
                            permuted(s.rotation, order),
                            permuted(s.opacity, order),
                            permuted(s.sh, order),
                            {},
                            {}},
                           scene.rays.origins,
                           scene.rays.directions};
  const Traced a = trace(scene, {}), b = trace(shuffled, {});
  expect_near(b.output.colour, a.output.colour, 1e-6);
  EXPECT_TRUE(same_bytes(a.output.alpha, b.output.alpha));
  EXPECT_TRUE(same_bytes(a.output.distance, b.output.distance));
  expect_near(b.gradient.surfels.position, permuted(a.gradient.surfels.position, order), 1e-3);
  expect_near(b.gradient.surfels.sh, permuted(a.gradient.surfels.sh, order), 1e-5);
}

TEST(Trace, HitsAtOneDistanceBlendInOrderOfIndex) {
  TestScene scene = blank_scene(70, 0, 1);
  for (int64_t i = 0; i < 70; ++i) {
    set_facing(scene.surfels, i, 1, 1, 0.5F);
    for (int c = 0; c < 3; ++c)
      scene.surfels.sh.row(i)[c] = static_cast<float>((i == 0 ? 0.5 : -0.5) / sh_c0);
  }
  scene.rays.directions(0, 2) = 1;
  for (const int k : {1, 64}) {
    Options options;
    options.hits_per_pass = k;
    EXPECT_NEAR(trace(scene, options).output.colour(0, 0), 0.5, 1e-6);
  }
}

// More hits on a ray than any buffer starts with.
TEST(Trace, AnyNumberOfHits) {
  constexpr int64_t count = 5000;
  TestScene scene = blank_scene(count, 0, 2);
  for (int64_t i = 0; i < count; ++i)
    set_facing(scene.surfels, i, 1 + 0.001F * static_cast<float>(i), 1, 0.004F);
  scene.rays.directions(0, 2) = 1;
  scene.rays.directions(1, 2) = 1;
  scene.rays.origins(1, 2) = 10;
  scene.rays.directions(1, 2) = -1;
  const Traced t = trace(scene, {});
  EXPECT_GT(t.hits, 4000);
  BasicOutput<double> truth;
  forward_reference(convert<double>(scene.surfels), convert<double>(scene.rays), {}, truth);
  expect_output_near(t.output, truth, 0);
}

TEST(Trace, ConesWithoutWidthAreRays) {
  TestScene scene = random_scene(14, {.surfels = 2000, .rays = 700, .scale_min = 0.02, .scale_max = 0.2});
  const Traced rays = trace(scene, {});
  scene.rays.widths = Tensor<float>({700});
  const Traced cones = trace(scene, {});
  expect_near(cones.output.colour, rays.output.colour, 1e-5);
  expect_near(cones.gradient.rays.origins, rays.gradient.rays.origins, 1e-3);
}

// Rays side by side share a walk; each on its own must find the same.
void expect_together_as_alone(float width) {
  const SceneOptions o{.surfels = 5000, .scale_min = 0.02, .scale_max = 0.2};
  TestScene scene = random_scene(61, o);
  constexpr int64_t side = 24;
  scene.rays.origins = Tensor<float>({side * side, 3});
  scene.rays.directions = Tensor<float>({side * side, 3});
  for (int64_t r = 0; r < side * side; ++r) {
    const int64_t column = r % side - side / 2, row = r / side - side / 2;
    store3(scene.rays.origins.row(r), Vec3<float>(0, 0, -3));
    store3(scene.rays.directions.row(r),
           Vec3<float>(0.01F * static_cast<float>(column), 0.01F * static_cast<float>(row), 1));
  }
  if (width > 0) {
    scene.rays.widths = Tensor<float>({side * side});
    for (int64_t r = 0; r < side * side; ++r) scene.rays.widths[r] = width * static_cast<float>(r % 5);
  }
  const Traced together = trace(scene, {});
  EXPECT_GT(together.hits, 10 * side * side);
  TestScene one{scene.surfels,
                {Tensor<float>({1, 3}), Tensor<float>({1, 3}), Tensor<float>({width > 0 ? 1 : 0})}};
  for (int64_t r = 0; r < side * side; r += 7) {
    std::copy_n(scene.rays.origins.row(r), 3, one.rays.origins.data());
    std::copy_n(scene.rays.directions.row(r), 3, one.rays.directions.data());
    if (width > 0) one.rays.widths[0] = scene.rays.widths[r];
    const Traced alone = trace(one, {});
    EXPECT_EQ(alone.output.alpha[0], together.output.alpha[r]);
    EXPECT_EQ(alone.output.distance[0], together.output.distance[r]);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(alone.output.colour(0, c), together.output.colour(r, c), 1e-6);
  }
}

TEST(Trace, RaysTogetherAndAloneAgree) { expect_together_as_alone(0); }
TEST(Trace, ConesTogetherAndAloneAgree) { expect_together_as_alone(0.02F); }

RC_GTEST_PROP(TraceProperty, FindsWhatBruteForceFinds, ()) {
  SceneOptions o;
  o.surfels = *rc::gen::inRange<int64_t>(0, 300);
  o.rays = 20;
  o.sh_degree = *rc::gen::inRange(0, 4);
  o.scale_min = 1e-3;
  o.scale_max = *rc::gen::element(0.01, 0.1, 1.0, 30.0);
  o.opacity_min = 0;
  o.opacity_max = *rc::gen::element(0.01, 0.5, 1.0);
  o.ray_distance = *rc::gen::element(0.0, 0.5, 3.0, 100.0);
  o.width_max = *rc::gen::element(0.0, 0.0, 0.001, 0.1, 10.0);
  const auto seed = *rc::gen::arbitrary<uint64_t>();
  Options options;
  options.hits_per_pass = *rc::gen::inRange(1, 20);
  expect_matches_reference(random_scene(seed, o), options, 0.1);
}

}  // namespace
}  // namespace traceflow::trace

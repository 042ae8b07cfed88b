#include <limits>

#include "ops/trace/trace_device_run.h"

namespace traceflow::trace {
namespace {

using namespace traceflow::testing;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr float largest = std::numeric_limits<float>::max();
constexpr float smallest = std::numeric_limits<float>::denorm_min();

using TraceHostileOnDevice = OnDevice;

// What is broken is left out on both, and the rest is the same.
TEST_F(TraceHostileOnDevice, SurfelsThatCannotBeHit) {
  int64_t broken = 0;
  TestScene scene = smooth_scene(1, 3, 100, 80);
  PosedSurfels& s = scene.surfels;
  for (const float value : {nan, infinite, -infinite}) {
    s.position(broken++, 1) = value;
    s.scale(broken++, 0) = value;
    s.rotation(broken++, 3) = value;
    s.opacity[broken++] = value;
    s.sh.row(broken++)[7] = value;
  }
  s.scale(broken++, 0) = 0;
  s.scale(broken++, 1) = -1;
  s.opacity[broken++] = 0;
  s.opacity[broken++] = -1;
  s.position(broken++, 0) = largest;
  s.position(broken++, 2) = -1e20F;
  s.scale(broken++, 0) = largest;
  const Traced found = trace_on_device(scene, smooth_options());
  EXPECT_TRUE(all_finite(found));
  expect_same(found, trace(scene, smooth_options()));
}

TEST_F(TraceHostileOnDevice, NoSurfelThatCanBeHit) {
  TestScene scene = smooth_scene(1, 1, 40, 40);
  for (int64_t i = 0; i < 40; ++i) scene.surfels.opacity[i] = nan;
  const Traced found = trace_on_device(scene, smooth_options());
  EXPECT_TRUE(all_finite(found));
  EXPECT_EQ(found.hits, 0);
  EXPECT_TRUE(same_bytes(found.output, trace(scene, smooth_options()).output));
}

TEST_F(TraceHostileOnDevice, ExtremeSurfelsAreFinite) {
  TestScene scene = smooth_scene(2, 3, 100, 80);
  PosedSurfels& s = scene.surfels;
  s.position(0, 0) = 1e14F;
  s.scale(1, 0) = 1e14F;
  s.scale(2, 0) = smallest;
  s.scale(3, 0) = s.scale(3, 1) = 1e-30F;
  for (int k = 0; k < 4; ++k) s.rotation(4, k) = 0;
  for (int k = 0; k < 4; ++k) s.rotation(5, k) = 1e-30F;
  for (int k = 0; k < 4; ++k) s.rotation(6, k) = 1e30F;
  s.opacity[7] = 5;
  const Traced found = trace_on_device(scene, {}), expected = trace(scene, {});
  EXPECT_TRUE(all_finite(found));
  EXPECT_NEAR(static_cast<double>(found.hits), static_cast<double>(expected.hits), 3);
}

TEST_F(TraceHostileOnDevice, RaysThatCannotBeTracedSeeTheBackground) {
  TestScene scene = smooth_scene(3, 2, 100, 80);
  int64_t broken = 0;
  for (const float value : {nan, infinite, -infinite}) {
    scene.origins(broken++, 0) = value;
    scene.directions(broken++, 2) = value;
  }
  for (int k = 0; k < 3; ++k) scene.directions(broken, k) = 0;
  const Traced found = trace_on_device(scene, smooth_options());
  EXPECT_TRUE(all_finite(found));
  EXPECT_EQ(found.output.colour(0, 1), smooth_options().background[1]);
  expect_same(found, trace(scene, smooth_options()));
}

TEST_F(TraceHostileOnDevice, ExtremeRays) {
  TestScene scene = smooth_scene(4, 1, 100, 80);
  for (int k = 0; k < 3; ++k) {
    scene.origins(0, k) = largest;
    scene.origins(1, k) = 1e20F;
    scene.directions(2, k) = smallest;
    scene.directions(3, k) = 1e-30F;
    scene.directions(4, k) = 1e30F;
    scene.directions(5, k) = largest;
  }
  scene.directions(6, 0) = scene.directions(6, 1) = -0.0F;
  scene.directions(7, 1) = scene.directions(7, 2) = 0;
  const Traced found = trace_on_device(scene, smooth_options()), expected = trace(scene, smooth_options());
  EXPECT_EQ(found.hits, expected.hits);
  EXPECT_EQ(count_far(found.output.colour, expected.output.colour, 2e-5), 0);
  EXPECT_EQ(count_far(found.output.alpha, expected.output.alpha, 2e-5), 0);
  // A gradient by a distance in units of a length of 1e-45 is beyond all measure on both.
  for (int64_t i = 0; i < found.gradient.surfels.position.size(); ++i) {
    EXPECT_EQ(std::isfinite(found.gradient.surfels.position[i]),
              std::isfinite(expected.gradient.surfels.position[i]));
  }
}

TEST_F(TraceHostileOnDevice, RayInsideAPlane) {
  TestScene scene{make_surfels(1, 0), Tensor<float>({2, 3}), Tensor<float>({2, 3})};
  set_facing(scene.surfels, 0, 1, 1, 0.5F);
  scene.directions(0, 0) = 1;  // parallel to the plane
  scene.origins(1, 0) = -5;    // in the plane
  scene.origins(1, 2) = 1;
  scene.directions(1, 0) = 1;
  const Traced found = trace_on_device(scene, {});
  EXPECT_EQ(found.hits, 0);
  EXPECT_TRUE(all_finite(found));
}

TEST_F(TraceHostileOnDevice, NothingToTrace) {
  const TestScene none{make_surfels(0, 3), Tensor<float>({3, 3}), Tensor<float>({3, 3})};
  const Traced found = trace_on_device(none, {});
  EXPECT_EQ(found.hits, 0);
  EXPECT_EQ(found.output.alpha.size(), 3);
  EXPECT_EQ(found.output.alpha[2], 0);
  EXPECT_TRUE(all_finite(found));
  const TestScene no_rays{smooth_scene(5, 2, 20, 1).surfels, Tensor<float>({0, 3}), Tensor<float>({0, 3})};
  EXPECT_EQ(trace_on_device(no_rays, {}).output.colour.size(), 0);
  const TestScene nothing{make_surfels(0, 0), Tensor<float>({0, 3}), Tensor<float>({0, 3})};
  EXPECT_EQ(trace_on_device(nothing, {}).hits, 0);
}

TEST_F(TraceHostileOnDevice, OneAndTwoSurfels) {
  for (const int64_t count : {1, 2}) {
    TestScene scene{make_surfels(count, 0), Tensor<float>({1, 3}), Tensor<float>({1, 3})};
    for (int64_t i = 0; i < count; ++i) set_facing(scene.surfels, i, 2 + static_cast<float>(i), 0.5F, 0.8F);
    scene.directions(0, 2) = 1;
    expect_same(trace_on_device(scene, {}), trace(scene, {}));
  }
}

// All in one place: keys are told apart by the index only.
TEST_F(TraceHostileOnDevice, ManySurfelsInOnePlace) {
  TestScene scene{make_surfels(3000, 0), Tensor<float>({1, 3}), Tensor<float>({1, 3})};
  for (int64_t i = 0; i < 3000; ++i) set_facing(scene.surfels, i, 1, 1, 0.01F);
  scene.directions(0, 2) = 1;
  const Traced found = trace_on_device(scene, {});
  EXPECT_EQ(found.hits, trace(scene, {}).hits);
  EXPECT_GT(found.output.alpha[0], 0.999F);
}

// Each surfel half as far as the one before: the tree is as deep as its keys are long.
TEST_F(TraceHostileOnDevice, SurfelsOfEveryScale) {
  constexpr int64_t count = 1000;
  TestScene scene{make_surfels(count, 0), Tensor<float>({1, 3}), Tensor<float>({1, 3})};
  for (int64_t i = 0; i < count; ++i) {
    const float depth = std::ldexp(1.0F, static_cast<int>(i % 100) - 90);
    set_facing(scene.surfels, i, depth, depth * 0.1F, 0.01F);
  }
  scene.directions(0, 2) = 1;
  Options options;
  options.t_min = 0;
  const Traced found = trace_on_device(scene, options), expected = trace(scene, options);
  EXPECT_EQ(found.hits, expected.hits);
  EXPECT_NEAR(found.output.alpha[0], expected.output.alpha[0], 1e-5);
}

}  // namespace
}  // namespace traceflow::trace

#include "ops/trace/trace_device_run.h"
#include "ops/trace/trace_hostile_scenes.h"

namespace traceflow::trace {
namespace {

using namespace traceflow::testing;

using TraceHostileOnDevice = OnDevice;

// What is broken is left out on both, and the rest is the same.
TEST_F(TraceHostileOnDevice, SurfelsThatCannotBeHit) {
  TestScene scene = smooth_scene(1, 3, 100, 80);
  int64_t broken = make_not_finite(scene.surfels);
  broken = take_area_or_opacity(scene.surfels, broken);
  move_beyond_measure(scene.surfels, broken);
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
  make_extreme(scene.surfels);
  const Traced found = trace_on_device(scene, {}), expected = trace(scene, {});
  EXPECT_TRUE(all_finite(found));
  EXPECT_NEAR(static_cast<double>(found.hits), static_cast<double>(expected.hits), 3);
}

TEST_F(TraceHostileOnDevice, RaysThatCannotBeTracedSeeTheBackground) {
  TestScene scene = smooth_scene(3, 2, 100, 80);
  break_rays(scene);
  const Traced found = trace_on_device(scene, smooth_options());
  EXPECT_TRUE(all_finite(found));
  EXPECT_EQ(found.output.colour(0, 1), smooth_options().background[1]);
  expect_same(found, trace(scene, smooth_options()));
}

TEST_F(TraceHostileOnDevice, ExtremeRays) {
  TestScene scene = smooth_scene(4, 1, 100, 80);
  make_rays_extreme(scene);
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
  const Traced found = trace_on_device(rays_inside_a_plane(), {});
  EXPECT_EQ(found.hits, 0);
  EXPECT_TRUE(all_finite(found));
}

TEST_F(TraceHostileOnDevice, NothingToTrace) {
  const Traced found = trace_on_device(blank_scene(0, 3, 3), {});
  EXPECT_EQ(found.hits, 0);
  EXPECT_EQ(found.output.alpha.size(), 3);
  EXPECT_EQ(found.output.alpha[2], 0);
  EXPECT_TRUE(all_finite(found));
  EXPECT_EQ(trace_on_device(blank_scene(0, 0, 0), {}).hits, 0);
}

// The surfels have gradients all the same, and those are zero.
TEST_F(TraceHostileOnDevice, SurfelsWithoutRays) {
  TestScene scene = smooth_scene(5, 2, 20, 0);
  make_not_finite(scene.surfels);
  for (const bool in_order : {false, true}) {
    const InOrder order(in_order);
    const Traced found = trace_on_device(scene, {});
    EXPECT_EQ(found.output.colour.size(), 0);
    EXPECT_EQ(found.gradient.surfels.position.dim(0), 20);
    EXPECT_TRUE(same_bytes(found.gradient, trace(scene, {}).gradient));
  }
}

TEST_F(TraceHostileOnDevice, OneAndTwoSurfels) {
  for (const int64_t count : {1, 2}) {
    const TestScene scene = surfels_in_a_row(count);
    expect_same(trace_on_device(scene, {}), trace(scene, {}));
  }
}

// Keys are told apart by the index only.
TEST_F(TraceHostileOnDevice, ManySurfelsInOnePlace) {
  const TestScene scene = surfels_in_one_place(3000);
  const Traced found = trace_on_device(scene, {});
  EXPECT_EQ(found.hits, trace(scene, {}).hits);
  EXPECT_GT(found.output.alpha[0], 0.999F);
}

// The tree is as deep as its keys are long.
TEST_F(TraceHostileOnDevice, SurfelsOfEveryScale) {
  const TestScene scene = surfels_of_every_scale(1000);
  Options options;
  options.t_min = 0;
  const Traced found = trace_on_device(scene, options), expected = trace(scene, options);
  EXPECT_EQ(found.hits, expected.hits);
  EXPECT_NEAR(found.output.alpha[0], expected.output.alpha[0], 1e-5);
}

}  // namespace
}  // namespace traceflow::trace

#include <gtest/gtest.h>

#include "ops/trace/trace_hostile_scenes.h"
#include "ops/trace/trace_run.h"

namespace traceflow::trace {
namespace {

TestScene clean_scene() { return random_scene(1, {.surfels = 200, .rays = 100}); }

// The set without its first `count` surfels.
PosedSurfels without_first(const PosedSurfels& from, int64_t count) {
  PosedSurfels to = make_surfels(from.count() - count, sh_degree(from.sh.dim(1)));
  for (int64_t i = count; i < from.count(); ++i) {
    std::copy_n(from.position.row(i), 3, to.position.row(i - count));
    std::copy_n(from.scale.row(i), 2, to.scale.row(i - count));
    std::copy_n(from.rotation.row(i), 4, to.rotation.row(i - count));
    to.opacity[i - count] = from.opacity[i];
    std::copy_n(from.sh.row(i), from.sh.row_size(), to.sh.row(i - count));
  }
  return to;
}

bool is_zero(const float* row, int64_t n) {
  return std::all_of(row, row + n, [](float v) { return v == 0; });
}

// A broken surfel is as good as absent, and has no gradient.
void expect_left_out(const TestScene& broken, int64_t count) {
  const Traced with = trace(broken, {});
  const Traced without = trace({without_first(broken.surfels, count), broken.rays}, {});
  EXPECT_TRUE(same_bytes(with.output, without.output));
  EXPECT_TRUE(all_finite(with));
  for (int64_t i = 0; i < count; ++i) {
    EXPECT_TRUE(is_zero(with.gradient.surfels.position.row(i), 3));
    EXPECT_TRUE(is_zero(with.gradient.surfels.scale.row(i), 2));
    EXPECT_TRUE(is_zero(with.gradient.surfels.rotation.row(i), 4));
    EXPECT_EQ(with.gradient.surfels.opacity[i], 0);
    EXPECT_TRUE(is_zero(with.gradient.surfels.sh.row(i), with.gradient.surfels.sh.row_size()));
    EXPECT_EQ(with.gradient.position_gradient[i], 0);
  }
}

TEST(TraceHostile, SurfelsThatAreNotFinite) {
  TestScene scene = clean_scene();
  const int64_t broken = make_not_finite(scene.surfels);
  expect_left_out(scene, broken);
}

TEST(TraceHostile, SurfelsWithoutAreaOrOpacity) {
  TestScene scene = clean_scene();
  const int64_t broken = take_area_or_opacity(scene.surfels);
  expect_left_out(scene, broken);
}

TEST(TraceHostile, SurfelsBeyondAllMeasure) {
  TestScene scene = clean_scene();
  const int64_t broken = move_beyond_measure(scene.surfels);
  expect_left_out(scene, broken);
}

TEST(TraceHostile, ExtremeSurfelsAreFinite) {
  TestScene scene = clean_scene();
  make_extreme(scene.surfels);
  EXPECT_TRUE(all_finite(trace(scene, {})));
}

void expect_first_see_the_background(const TestScene& scene, int64_t broken) {
  Options options;
  options.background = {0.25F, 0.5F, 0.75F};
  const Traced t = trace(scene, options);
  EXPECT_TRUE(all_finite(t));
  for (int64_t r = 0; r < broken; ++r) {
    for (int c = 0; c < 3; ++c) EXPECT_EQ(t.output.colour(r, c), options.background[c]);
    EXPECT_EQ(t.output.alpha[r], 0);
    EXPECT_EQ(t.output.distance[r], 0);
    EXPECT_TRUE(is_zero(t.gradient.rays.origins.row(r), 3));
    EXPECT_TRUE(is_zero(t.gradient.rays.directions.row(r), 3));
    EXPECT_TRUE(scene.rays.widths.empty() || t.gradient.rays.widths[r] == 0);
  }
}

TEST(TraceHostile, RaysThatCannotBeTracedSeeTheBackground) {
  TestScene scene = clean_scene();
  const int64_t broken = break_rays(scene);
  expect_first_see_the_background(scene, broken);
}

TEST(TraceHostile, ConesThatCannotBeTracedSeeTheBackground) {
  TestScene scene = clean_scene();
  const int64_t broken = break_widths(scene);
  expect_first_see_the_background(scene, broken);
}

TEST(TraceHostile, ExtremeCones) {
  TestScene scene = clean_scene();
  make_extreme(scene.surfels);
  scene.rays.widths = Tensor<float>({scene.rays.count()});
  for (int64_t r = 0; r < scene.rays.count(); ++r)
    scene.rays.widths[r] = r % 3 == 0 ? largest : r % 3 == 1 ? 1e10F : smallest;
  EXPECT_TRUE(all_finite(trace(scene, {})));
}

TEST(TraceHostile, ExtremeRays) {
  TestScene scene = clean_scene();
  make_rays_extreme(scene);
  const Traced t = trace(scene, {});
  EXPECT_TRUE(all_finite(t.output.colour));
  EXPECT_TRUE(all_finite(t.output.alpha));
  EXPECT_TRUE(all_finite(t.gradient.surfels.position));
}

// The image does not depend on the length of a direction; the distance is in its units.
TEST(TraceHostile, LengthOfTheDirection) {
  TestScene scene = clean_scene();
  const Traced one = trace(scene, {});
  for (float& v : scene.rays.directions.values()) v *= 0x1p-60F;
  const Traced shorter = trace(scene, {});
  EXPECT_TRUE(same_bytes(one.output.colour, shorter.output.colour));
  for (int64_t r = 0; r < scene.rays.count(); ++r) {
    EXPECT_EQ(shorter.output.distance[r], one.output.distance[r] * 0x1p60F);
  }
}

TEST(TraceHostile, RayInsideAPlane) {
  const Traced t = trace(rays_inside_a_plane(), {});
  EXPECT_EQ(t.hits, 0);
  EXPECT_TRUE(all_finite(t));
}

TEST(TraceHostile, NothingToTrace) {
  const Traced t = trace(blank_scene(0, 3, 3), {});
  EXPECT_EQ(t.hits, 0);
  EXPECT_EQ(t.output.alpha.size(), 3);
  EXPECT_EQ(t.output.alpha[2], 0);
  const TestScene no_rays{clean_scene().surfels, {}};
  EXPECT_EQ(trace(no_rays, {}).output.colour.size(), 0);
  EXPECT_EQ(trace({{}, {}}, {}).hits, 0);
}

TEST(TraceHostile, OneSurfel) { EXPECT_NEAR(trace(surfels_in_a_row(1), {}).output.alpha[0], 0.8F, 1e-6); }

// No plane cuts them apart.
TEST(TraceHostile, ManySurfelsInOnePlace) {
  const Traced t = trace(surfels_in_one_place(10000), {});
  EXPECT_GT(t.hits, 900);
  EXPECT_GT(t.output.alpha[0], 0.999F);
}

// The tree would grow deep.
TEST(TraceHostile, SurfelsOfEveryScale) {
  const TestScene scene = surfels_of_every_scale(2000);
  Options options;
  options.t_min = 0;
  BasicOutput<double> truth;
  forward_reference(convert<double>(scene.surfels), convert<double>(scene.rays), options, truth);
  EXPECT_NEAR(trace(scene, options).output.alpha[0], truth.alpha[0], 1e-4);
}

TEST(TraceHostile, OptionsAreChecked) {
  const auto refuses = [](auto&& change) {
    Options options;
    change(options);
    EXPECT_THROW(options.validate(), InputError);
  };
  EXPECT_NO_THROW(Options{}.validate());
  refuses([](Options& o) { o.t_min = -1; });
  refuses([](Options& o) { o.alpha_min = 0; });
  refuses([](Options& o) { o.alpha_max = 1; });
  refuses([](Options& o) { o.transmittance_min = nan; });
  refuses([](Options& o) { o.hits_per_pass = 0; });
}

}  // namespace
}  // namespace traceflow::trace

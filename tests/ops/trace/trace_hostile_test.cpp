#include <gtest/gtest.h>

#include <limits>

#include "ops/trace/trace_run.h"

namespace traceflow::trace {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr float largest = std::numeric_limits<float>::max();
constexpr float smallest = std::numeric_limits<float>::denorm_min();

TestScene clean_scene() {
  SceneOptions o;
  o.surfels = 200;
  o.rays = 100;
  return random_scene(1, o);
}

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
  const Traced without = trace({without_first(broken.surfels, count), broken.origins, broken.directions}, {});
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
  int64_t broken = 0;
  TestScene scene = clean_scene();
  PosedSurfels& s = scene.surfels;
  for (const float value : {nan, infinite, -infinite}) {
    s.position(broken++, 1) = value;
    s.scale(broken++, 0) = value;
    s.rotation(broken++, 3) = value;
    s.opacity[broken++] = value;
    s.sh.row(broken++)[7] = value;
  }
  expect_left_out(scene, broken);
}

TEST(TraceHostile, SurfelsWithoutAreaOrOpacity) {
  TestScene scene = clean_scene();
  scene.surfels.scale(0, 0) = 0;
  scene.surfels.scale(1, 1) = -1;
  scene.surfels.scale(2, 0) = -0.0F;
  scene.surfels.opacity[3] = 0;
  scene.surfels.opacity[4] = -1;
  scene.surfels.opacity[5] = 0.5F / 255;
  expect_left_out(scene, 6);
}

TEST(TraceHostile, SurfelsBeyondAllMeasure) {
  TestScene scene = clean_scene();
  scene.surfels.position(0, 0) = largest;
  scene.surfels.position(1, 2) = -1e20F;
  scene.surfels.scale(2, 0) = largest;
  expect_left_out(scene, 3);
}

TEST(TraceHostile, ExtremeSurfelsAreFinite) {
  TestScene scene = clean_scene();
  PosedSurfels& s = scene.surfels;
  s.position(0, 0) = 1e14F;
  s.scale(1, 0) = 1e14F;
  s.scale(2, 0) = smallest;
  s.scale(3, 0) = s.scale(3, 1) = 1e-30F;
  for (int k = 0; k < 4; ++k) s.rotation(4, k) = 0;
  for (int k = 0; k < 4; ++k) s.rotation(5, k) = 1e-30F;
  for (int k = 0; k < 4; ++k) s.rotation(6, k) = 1e30F;
  s.opacity[7] = 5;
  EXPECT_TRUE(all_finite(trace(scene, {})));
}

TEST(TraceHostile, RaysThatCannotBeTracedSeeTheBackground) {
  TestScene scene = clean_scene();
  int64_t broken = 0;
  for (const float value : {nan, infinite, -infinite}) {
    scene.origins(broken++, 0) = value;
    scene.directions(broken++, 2) = value;
  }
  for (int k = 0; k < 3; ++k) scene.directions(broken, k) = 0;
  ++broken;
  Options options;
  options.background = {0.25F, 0.5F, 0.75F};
  const Traced t = trace(scene, options);
  EXPECT_TRUE(all_finite(t));
  for (int64_t r = 0; r < broken; ++r) {
    for (int c = 0; c < 3; ++c) EXPECT_EQ(t.output.colour(r, c), options.background[c]);
    EXPECT_EQ(t.output.alpha[r], 0);
    EXPECT_EQ(t.output.distance[r], 0);
    EXPECT_TRUE(is_zero(t.gradient.origins.row(r), 3));
    EXPECT_TRUE(is_zero(t.gradient.directions.row(r), 3));
  }
}

TEST(TraceHostile, ExtremeRays) {
  TestScene scene = clean_scene();
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
  const Traced t = trace(scene, {});
  EXPECT_TRUE(all_finite(t.output.colour));
  EXPECT_TRUE(all_finite(t.output.alpha));
  EXPECT_TRUE(all_finite(t.gradient.surfels.position));
}

// The image does not depend on the length of a direction; the distance is in its units.
TEST(TraceHostile, LengthOfTheDirection) {
  TestScene scene = clean_scene();
  const Traced one = trace(scene, {});
  for (float& v : scene.directions.values()) v *= 0x1p-60F;
  const Traced shorter = trace(scene, {});
  EXPECT_TRUE(same_bytes(one.output.colour, shorter.output.colour));
  for (int64_t r = 0; r < scene.origins.dim(0); ++r) {
    EXPECT_EQ(shorter.output.distance[r], one.output.distance[r] * 0x1p60F);
  }
}

TEST(TraceHostile, RayInsideAPlane) {
  TestScene scene{make_surfels(1, 0), Tensor<float>({2, 3}), Tensor<float>({2, 3})};
  set_facing(scene.surfels, 0, 1, 1, 0.5F);
  scene.directions(0, 0) = 1;  // parallel to the plane
  scene.origins(1, 0) = -5;    // in the plane
  scene.origins(1, 2) = 1;
  scene.directions(1, 0) = 1;
  const Traced t = trace(scene, {});
  EXPECT_EQ(t.hits, 0);
  EXPECT_TRUE(all_finite(t));
}

TEST(TraceHostile, NothingToTrace) {
  const TestScene none{make_surfels(0, 3), Tensor<float>({3, 3}), Tensor<float>({3, 3})};
  const Traced t = trace(none, {});
  EXPECT_EQ(t.hits, 0);
  EXPECT_EQ(t.output.alpha.size(), 3);
  EXPECT_EQ(t.output.alpha[2], 0);
  const TestScene no_rays{clean_scene().surfels, {}, {}};
  EXPECT_EQ(trace(no_rays, {}).output.colour.size(), 0);
  EXPECT_EQ(trace({{}, {}, {}}, {}).hits, 0);
}

TEST(TraceHostile, OneSurfel) {
  TestScene scene{make_surfels(1, 0), Tensor<float>({1, 3}), Tensor<float>({1, 3})};
  set_facing(scene.surfels, 0, 2, 0.5F, 0.8F);
  scene.directions(0, 2) = 1;
  EXPECT_NEAR(trace(scene, {}).output.alpha[0], 0.8F, 1e-6);
}

// All in one place: no plane cuts them apart.
TEST(TraceHostile, ManySurfelsInOnePlace) {
  constexpr int64_t count = 10000;
  TestScene scene{make_surfels(count, 0), Tensor<float>({1, 3}), Tensor<float>({1, 3})};
  for (int64_t i = 0; i < count; ++i) set_facing(scene.surfels, i, 1, 1, 0.01F);
  scene.directions(0, 2) = 1;
  const Traced t = trace(scene, {});
  EXPECT_GT(t.hits, 900);
  EXPECT_GT(t.output.alpha[0], 0.999F);
}

// Each surfel half as far as the one before: the tree would grow deep.
TEST(TraceHostile, SurfelsOfEveryScale) {
  constexpr int64_t count = 2000;
  TestScene scene{make_surfels(count, 0), Tensor<float>({1, 3}), Tensor<float>({1, 3})};
  for (int64_t i = 0; i < count; ++i) {
    const float depth = std::ldexp(1.0F, static_cast<int>(i % 100) - 90);
    set_facing(scene.surfels, i, depth, depth * 0.1F, 0.01F);
  }
  scene.directions(0, 2) = 1;
  Options options;
  options.t_min = 0;
  BasicOutput<double> truth;
  forward_reference(convert<double>(scene.surfels), convert<double>(scene.origins),
                    convert<double>(scene.directions), options, truth);
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

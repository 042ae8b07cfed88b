#include "capture/synth/trace.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "capture/synth/scenes.h"

namespace traceflow::synth {
namespace {

constexpr double pi = std::numbers::pi;

Material matt(const Vector& colour) { return {.albedo = {.first = colour}}; }

Material mirror(const Vector& tint = Vector(1)) { return {.albedo = {.first = Vector(0)}, .specular = tint}; }

Material lamp(double emission) {
  Material material = matt(Vector(0));
  material.emission = Vector(emission);
  return material;
}

Mat3<double> facing(const Vector& axis, double angle) { return rotation_about(axis, angle); }

Radiance mean_radiance(const Stage& stage, const Ray& ray, uint32_t samples) {
  Radiance sum;
  for (uint32_t sample = 0; sample < samples; ++sample) {
    Sampler sampler(11, sample, samples);
    const Radiance seen = trace_path(stage, ray, sampler);
    sum.diffuse += seen.diffuse / static_cast<double>(samples);
    sum.specular += seen.specular / static_cast<double>(samples);
  }
  return sum;
}

void expect_near(const Vector& found, const Vector& expected, double tolerance) {
  EXPECT_NEAR(length(found - expected), 0, tolerance)
      << found.x << ' ' << found.y << ' ' << found.z << " instead of " << expected.x << ' ' << expected.y
      << ' ' << expected.z;
}

TEST(SynthTrace, NearestOfSeveralBodiesIsFoundWithTheNormalTowardsTheViewer) {
  Stage stage;
  stage.bodies.emplace_back(Plane{}, matt(Vector(1)), Pose{});
  stage.bodies.emplace_back(Sphere{0.5}, matt(Vector(1)), Pose{{0, 0, 1}});
  stage.bodies.emplace_back(Box{Vector(0.1)}, matt(Vector(1)), Pose{{0, 0, 2.5}});
  const auto hit = nearest_hit(stage, {{0, 0, 2}, {0, 0, -1}});
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->body, 1);
  EXPECT_NEAR(hit->distance, 0.5, 1e-12);
  expect_near(hit->point, {0, 0, 1.5}, 1e-12);
  expect_near(hit->normal, {0, 0, 1}, 1e-12);
  const auto inside = nearest_hit(stage, {{0, 0, 1}, {0, 0, -1}});
  ASSERT_TRUE(inside);
  expect_near(inside->normal, {0, 0, 1}, 1e-12);
}

TEST(SynthTrace, PoseOfABodyTurnsHitAndNormal) {
  Stage stage;
  const Mat3<double> turn = rotation_about({0, 0, 1}, pi / 4);
  stage.bodies.emplace_back(Box{{1, 1, 1}}, matt(Vector(1)), Pose{{5, 0, 0}, turn});
  const auto edge = nearest_hit(stage, {{0, 1e-9, 0}, {1, 0, 0}});
  ASSERT_TRUE(edge);
  EXPECT_NEAR(edge->distance, 5 - std::sqrt(2.0), 1e-6);
  const auto face = nearest_hit(stage, {{0, 0.5, 0}, {1, 0, 0}});
  ASSERT_TRUE(face);
  expect_near(face->normal, {-std::sqrt(0.5), std::sqrt(0.5), 0}, 1e-12);
}

TEST(SynthTrace, MirrorShowsTheKnownPoint) {
  // A mirror in the plane z = 0; the eye at (-1, 0, 1) looks at the origin and so sees the wall x = 2 at (2,
  // 0, 2), where a small coloured box stands.
  Stage stage;
  stage.ambient = 1;
  stage.bodies.emplace_back(Disk{0.5}, mirror(Vector(0.9, 0.8, 0.7)), Pose{});
  stage.bodies.emplace_back(Plane{}, matt(Vector(0.1)), Pose{{2, 0, 0}, facing({0, 1, 0}, -pi / 2)});
  stage.bodies.emplace_back(Box{Vector(0.02)}, matt({0.2, 0.5, 0.9}), Pose{{2, 0, 2}});
  const Ray ray{{-1, 0, 1}, normalize(Vector(1, 0, -1))};
  const Radiance seen = mean_radiance(stage, ray, 1);
  const Vector coat = coat_reflectance(mirror(Vector(0.9, 0.8, 0.7)), std::sqrt(0.5));
  expect_near(seen.diffuse, Vector(0), 0);
  expect_near(seen.specular, coat * Vector(0.2, 0.5, 0.9), 1e-12);
  const Ray aside{{-1, 0, 1}, normalize(Vector(1, 0.05, -1))};
  expect_near(mean_radiance(stage, aside, 1).specular,
              coat_reflectance(mirror(Vector(0.9, 0.8, 0.7)), -aside.direction.z) * 0.1, 1e-12);
}

TEST(SynthTrace, MirrorBallShowsWhatLiesInTheReflectedDirection) {
  // On a unit ball the normal at 45° turns a horizontal view straight up.
  Stage stage;
  stage.ambient = 1;
  const double h = std::sqrt(0.5);
  stage.bodies.emplace_back(Sphere{1}, mirror(), Pose{});
  stage.bodies.emplace_back(Box{Vector(0.01)}, matt({1, 0, 0}), Pose{{-h, 0, 4}});
  stage.bodies.emplace_back(Plane{}, matt(Vector(0)), Pose{{0, 0, 5}});
  expect_near(mean_radiance(stage, {{-5, 0, h}, {1, 0, 0}}, 1).specular, {1, 0, 0}, 1e-9);
}

TEST(SynthTrace, CoatFollowsSchlick) {
  const Material material = mirror(Vector(0.04));
  EXPECT_DOUBLE_EQ(coat_reflectance(material, 1).x, 0.04);
  EXPECT_DOUBLE_EQ(coat_reflectance(material, 0).x, 1);
  EXPECT_DOUBLE_EQ(coat_reflectance(material, 0.5).x, 0.04 + 0.96 / 32);
  EXPECT_EQ(coat_reflectance(matt(Vector(1)), 0), Vector(0));
}

TEST(SynthTrace, DirectLightOfADiskMatchesItsFormFactor) {
  // A disk of radius r at height h over a facing point lights it by r² / (r² + h²) of its radiance.
  constexpr double radius = 0.8;
  constexpr double height = 1.3;
  Stage stage;
  stage.bodies.emplace_back(Plane{}, matt(Vector(1)), Pose{});
  stage.bodies.emplace_back(Disk{radius}, lamp(2), Pose{{0, 0, height}});
  stage.light = 1;
  const Vector seen = mean_radiance(stage, {{0, 0, 1}, {0, 0, -1}}, 4096).diffuse;
  EXPECT_NEAR(seen.x, 2 * radius * radius / (radius * radius + height * height), 2e-3);
}

TEST(SynthTrace, HalfHiddenLightGivesHalf) {
  // A great box whose edge passes under the light's centre hides half of it from the point below.
  Stage stage;
  stage.bodies.emplace_back(Plane{}, matt(Vector(1)), Pose{});
  stage.bodies.emplace_back(Disk{0.5}, lamp(1), Pose{{0, 0, 2}});
  stage.bodies.emplace_back(Box{{5, 5, 0.01}}, matt(Vector(0)), Pose{{5, 0, 1}});
  stage.light = 1;
  const Ray ray{{-0.3, 0, 0.5}, normalize(Vector(0.3, 0, -0.5))};
  const double lit = mean_radiance(stage, ray, 4096).diffuse.x;
  EXPECT_NEAR(lit, 0.5 * 0.25 / (0.25 + 4), 2e-3);
  EXPECT_TRUE(is_shadowed(stage, {0, 0, 0}, {0.3, 0, 2}));
  EXPECT_FALSE(is_shadowed(stage, {0, 0, 0}, {-0.3, 0, 2}));
}

TEST(SynthTrace, WhiteFurnaceStaysWhite) {
  // Where everything is white and the light comes from everywhere, nothing can be told apart.
  for (const double specular : {0.0, 0.3, 1.0}) {
    for (const double roughness : {0.0, 0.2}) {
      Stage stage;
      stage.ambient = 1;
      stage.bodies.emplace_back(Plane{}, matt(Vector(1)), Pose{{0, 0, -1}});
      Material material = matt(Vector(1));
      material.specular = Vector(specular);
      material.roughness = roughness;
      stage.bodies.emplace_back(Sphere{1}, material, Pose{});
      for (const double offset : {0.0, 0.5, 0.99}) {
        const Radiance seen = mean_radiance(stage, {{-4, offset, 0.1}, {1, 0, 0}}, 16);
        expect_near(seen.diffuse + seen.specular, Vector(1), 1e-12);
      }
    }
  }
}

TEST(SynthTrace, FacingMirrorsEnd) {
  Stage stage;
  stage.ambient = 0.5;
  stage.bodies.emplace_back(Plane{}, mirror(), Pose{});
  stage.bodies.emplace_back(Plane{}, mirror(), Pose{{0, 0, 1}});
  expect_near(mean_radiance(stage, {{0, 0, 0.5}, {0, 0, 1}}, 1).specular, Vector(0.5), 1e-12);
}

TEST(SynthTrace, NamedScenesSendBackNoMoreThanTheyReceive) {
  for (const SynthScene name :
       {SynthScene::balls, SynthScene::mirror, SynthScene::tumble, SynthScene::soft}) {
    Stage stage = make_scene(name).at(0.3);
    for (Body& body : stage.bodies) body.material.emission = Vector(0);
    stage.light = -1;
    stage.ambient = 1;
    Random random(1);
    for (uint32_t i = 0; i < 5000; ++i) {
      const Ray ray{{0.2, -1.1, 0.6}, normalize(Vector(random.normal(), random.normal(), random.normal()))};
      Sampler sampler(3, i, 5000);
      const Radiance seen = trace_path(stage, ray, sampler);
      const Vector sum = seen.diffuse + seen.specular;
      ASSERT_LE(std::max({sum.x, sum.y, sum.z}), 1 + 1e-12);
      ASSERT_GE(std::min({sum.x, sum.y, sum.z}), 0);
    }
  }
}

}  // namespace
}  // namespace traceflow::synth

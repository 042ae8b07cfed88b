#include "viz/probe.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/cloud.h"

namespace traceflow::viz {
namespace {

void expect_near(const Vec3<float>& found, const Vec3<float>& expected, float tolerance, const char* what) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], tolerance) << what << ", component " << c;
}

// The first of a pixel's samples that the frame traced; as many as were traced where none is.
int64_t first_traced(const Frame& frame, int x, int y) {
  const int n = frame.samples, row = n * frame.camera.width;
  const auto is_of_pixel = [&](int32_t sample) { return sample / row / n == y && sample % row / n == x; };
  return std::ranges::find_if(frame.traced.pixel.values(), is_of_pixel) - frame.traced.pixel.values().begin();
}

class ProbeOfSamples : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(PerSide, ProbeOfSamples, ::testing::Values(1, 2));

// The whole frame's layers are the oracle.
TEST_P(ProbeOfSamples, FindsWhatTheFrameShows) {
  const Fixture f;
  RenderOptions options;
  options.samples = GetParam();
  Renderer renderer(options), probing(options);
  const Frame& frame = renderer.forward(f.scene, f.request);
  const Tensor<float> specular = frame.specular_image();
  FrameRequest again = f.request;
  again.reuse_pose = true;
  int hits = 0, mirrored = 0;
  for (const auto& [x, y] : {std::pair{0, 0}, {63, 47}, {32, 24}, {20, 30}, {41, 11}, {5, 40}, {17, 16}}) {
    const std::optional<ProbeResult> found =
        probe(probing, f.scene, hits == 0 ? f.request : again, x + 0.3, y + 0.9);
    const float alpha = frame.raster.alpha(y, x);
    ASSERT_EQ(found.has_value(), alpha >= renderer.options().select.min_alpha) << x << " " << y;
    if (!found) continue;
    ++hits;
    EXPECT_NEAR(found->alpha, alpha, 1e-5F);
    EXPECT_NEAR(found->depth, frame.raster.depth(y, x), 1e-5F);
    EXPECT_NEAR(found->tint, frame.raster.tint(y, x), 1e-5F);
    expect_near(found->colour, load3<float>(&frame.colour(y, x, 0)), 1e-4F, "colour");
    expect_near(found->diffuse, load3<float>(&frame.raster.colour(y, x, 0)), 1e-5F, "diffuse");
    expect_near(found->specular, load3<float>(&specular(y, x, 0)), 1e-4F, "specular");
    const Vec3<float> ray =
        f.request.camera.ray_in_world(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
    expect_near(found->surface, f.request.camera.position + frame.raster.depth(y, x) * ray, 1e-4F, "surface");
    expect_near(found->normal, normalize(load3<float>(&frame.raster.normal(y, x, 0))), 1e-4F, "normal");
    const int64_t k = first_traced(frame, x, y);
    ASSERT_EQ(found->mirrored.has_value(), k < frame.traced.pixel.size());
    if (!found->mirrored) continue;
    ++mirrored;
    expect_near(found->mirrored->direction, load3<float>(frame.mirrored.rays.directions.row(k)), 1e-4F,
                "mirrored");
    EXPECT_NEAR(found->mirrored->alpha, frame.mirrored.alpha[k], 1e-3F);
    EXPECT_NEAR(found->mirrored->distance, frame.mirrored.distance[k], 1e-2F);
  }
  EXPECT_GE(hits, 4);
  EXPECT_GE(mirrored, 3);
}

// One surfel, turned about the y axis: its normal is (sin angle, 0, cos angle).
Surfels turned(Vec3<float> position, float angle, float scale, bool tint) {
  Random random(1);
  Surfels s = scattered(1, 0, tint, random);
  store3(s.position.data(), position);
  s.log_scale.fill(std::log(scale));
  const std::array<float, 4> rotation = {std::cos(angle / 2), 0, std::sin(angle / 2), 0};
  std::copy(rotation.begin(), rotation.end(), s.rotation.data());
  s.opacity_logit.fill(8);
  return s;
}

// A mirror through the origin that turns the view along z to the view along x, where a surfel stands at x
// = 2.
struct MirrorScene : Fixture {
  MirrorScene() {
    constexpr float right_angle = 1.57079633F;
    scene.main = turned({0, 0, 0}, 1.5F * right_angle, 1, true);
    scene.environment = turned({2, 0, 0}, right_angle, 1, false);
    scene.main_field.reset();
    request.camera.centre_x = 32.5F;
    request.camera.centre_y = 24.5F;
  }
};

TEST(Probe, FollowsAMirroredRayToItsEnd) {
  const MirrorScene f;
  Renderer renderer(RenderOptions{});
  for (const auto& [x, y] : {std::pair{32, 24}, {38, 24}, {32, 20}, {28, 30}}) {
    const std::optional<ProbeResult> found = probe(renderer, f.scene, f.request, x, y);
    ASSERT_TRUE(found && found->mirrored);
    // By hand: the mirror is x = z; mirrored there, (a, b, c) becomes (c, b, a).
    const double a = (x - 32) / 70.0, b = (y - 24) / 70.0;
    const double t = 3 / (1 - a);
    const Vec3<double> surface(t * a, t * b, t - 3);
    const Vec3<double> direction(1, b, a);
    const Vec3<double> end = surface + (2 - surface.x) * direction;
    expect_near(found->surface, Vec3<float>(surface), 1e-5F, "surface");
    expect_near(found->normal, {std::sqrt(0.5F), 0, -std::sqrt(0.5F)}, 1e-6F, "normal");
    EXPECT_NEAR(found->depth, t, 1e-5);
    expect_near(found->mirrored->direction, Vec3<float>(normalize(direction)), 1e-6F, "direction");
    expect_near(found->mirrored->end, Vec3<float>(end), 1e-4F, "end");
    EXPECT_NEAR(found->mirrored->distance, length(end - surface), 1e-4);
    const double r2 = (end.y * end.y) + (end.z * end.z);
    EXPECT_NEAR(found->mirrored->alpha, std::min(0.99, 0.99966 * std::exp(-0.5 * r2)), 1e-4);
  }
}

TEST(Probe, WhatIsNotMirroredIsLeftOut) {
  MirrorScene f;
  Renderer renderer(RenderOptions{});
  f.scene.environment.position.fill(1000);
  const auto past = probe(renderer, f.scene, f.request, 32, 24);
  ASSERT_TRUE(past && past->mirrored);
  EXPECT_EQ(past->mirrored->alpha, 0);
  EXPECT_EQ(past->mirrored->distance, 0);
  f.scene.main.tint_logit.fill(-20);
  const auto dull = probe(renderer, f.scene, f.request, 32, 24);
  ASSERT_TRUE(dull);
  EXPECT_FALSE(dull->mirrored);
  EXPECT_EQ(dull->specular, Vec3<float>(0));
}

TEST(Probe, FindsNothingOffThePictureAndBesideTheSurface) {
  const MirrorScene f;
  Renderer renderer(RenderOptions{});
  const auto hit = [&](double x, double y) { return probe(renderer, f.scene, f.request, x, y).has_value(); };
  EXPECT_TRUE(hit(32, 24));
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const auto& [x, y] : {std::pair{-0.01, 24.0},
                             {64.0, 24.0},
                             {32.0, 48.0},
                             {infinity, 0.0},
                             {std::nan(""), 24.0},
                             {32.0, -infinity}}) {
    EXPECT_FALSE(hit(x, y)) << x << " " << y;
  }
  FrameRequest away = f.request;
  away.camera.position.z = 3;
  EXPECT_FALSE(probe(renderer, f.scene, away, 32, 24)) << "the surface is behind";
}

TEST(Probe, SpeaksTheCapturesUnits) {
  const MirrorScene f;
  Renderer renderer(RenderOptions{});
  const ProbeResult scene = probe(renderer, f.scene, f.request, 32, 24).value();
  const ProbeResult capture = in_capture(scene, {{10, 20, 30}, 0.5});
  expect_near(capture.surface, {10, 20, 30}, 1e-5F, "surface");
  expect_near(capture.mirrored->end, {14, 20, 30}, 1e-3F, "end");
  EXPECT_NEAR(capture.mirrored->distance, 4, 1e-3);
  EXPECT_EQ(capture.depth, 2 * scene.depth);
  EXPECT_EQ(capture.mirrored->direction, scene.mirrored->direction);
  EXPECT_EQ(capture.normal, scene.normal);
}

}  // namespace
}  // namespace traceflow::viz

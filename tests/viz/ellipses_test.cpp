#include "viz/ellipses.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "math/surfel_hit.h"
#include "render/cloud.h"
#include "viz/layers.h"

namespace traceflow::viz {
namespace {

PosedSurfels posed_cloud(int64_t count, float spread, uint64_t seed) {
  Random random(seed);
  Surfels s = scattered(count, spread, true, random);
  for (float& v : s.log_scale.values()) v = static_cast<float>(random.uniform(-4, -0.5));
  for (float& v : s.opacity_logit.values()) v = static_cast<float>(random.uniform(-4, 4));
  PosedSurfels posed;
  deform::forward(s, nullptr, 0, {}, 1, field::Precision::fp32, posed, nullptr);
  return posed;
}

raster::Options with_background() {
  raster::Options options;
  options.background = {0.1F, 0.5F, 1.5F};
  return options;
}

bool finite(const float* values, int64_t n) {
  return std::all_of(values, values + n, [](float v) { return std::isfinite(v); });
}

// Every surfel at every pixel, by the ray's own hit.
Tensor<float> oracle(const PosedSurfels& s, const Camera<float>& seen_by, const raster::Options& options) {
  const Camera<double> camera = convert<double>(seen_by);
  Tensor<float> picture(Shape{camera.height, camera.width, 3});
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vec3<double> ray = camera.ray_in_world(x + 0.5, y + 0.5);
      double nearest = HUGE_VAL;
      Vec3<float> colour = clamp(options.background, 0.0F, 1.0F);
      for (int64_t i = 0; i < s.count(); ++i) {
        if (!finite(s.position.row(i), 3) || !finite(s.scale.row(i), 2) || !finite(s.rotation.row(i), 4) ||
            !finite(s.sh.row(i), s.sh.row_size()) || !std::isfinite(s.tint[i]) || !(s.opacity[i] >= 0.05F) ||
            !(s.scale(i, 0) > 0 && s.scale(i, 1) > 0)) {
          continue;
        }
        const SurfelFrame<double> frame = {load3<double>(s.position.row(i)),
                                           rotation_from_quaternion(load4<double>(s.rotation.row(i))),
                                           {s.scale(i, 0), s.scale(i, 1)}};
        if (options.sort == raster::SortOrder::centre &&
            camera.point_in_camera(frame.position).z < options.near_plane) {
          continue;
        }
        const SurfelHit<double> hit = intersect(frame, camera.position, ray);
        const double rho = hit.u * hit.u + hit.v * hit.v;
        // The ray's camera z is 1, so t is the depth.
        if (!hit.valid || !(rho <= 1) || !(hit.t >= options.near_plane) || !(hit.t < nearest)) continue;
        nearest = hit.t;
        const auto seen =
            Vec3<float>(sh_colour<double>(1, s.sh.row(i), normalize(frame.position - camera.position)));
        colour = ellipse_colour(seen, std::abs(dot(frame.rotation[2], normalize(ray))), rho);
      }
      store3(&picture(y, x, 0), colour);
    }
  }
  return picture;
}

void expect_same(const Tensor<float>& found, const Tensor<float>& expected) {
  ASSERT_EQ(found.shape(), expected.shape());
  for (int64_t i = 0; i < found.size(); ++i) {
    ASSERT_NEAR(found[i], expected[i], 1e-5F) << "number " << i << " of " << found.shape().to_string();
  }
}

// How much of a picture is not background.
double covered(const Tensor<float>& picture, const raster::Options& options) {
  int64_t count = 0;
  for (int64_t i = 0; i < picture.size(); i += 3) {
    if (load3<float>(picture.data() + i) != clamp(options.background, 0.0F, 1.0F)) ++count;
  }
  return 3.0 * static_cast<double>(count) / static_cast<double>(picture.size());
}

TEST(Ellipses, AreWhatEveryRayMeetsFirst) {
  const Fixture f;
  raster::Options options = with_background();
  for (const uint64_t seed : {1U, 2U, 3U}) {
    for (const auto sort : {raster::SortOrder::centre, raster::SortOrder::hit}) {
      options.sort = sort;
      const PosedSurfels surfels = posed_cloud(400, 1.5F, seed);
      Camera<float> camera = f.request.camera;
      expect_same(surfel_ellipses(surfels, camera, options), oracle(surfels, camera, options));
      // From amidst them, so that disks cross the near plane and lie behind; and a picture of odd size.
      camera.position = {0.1F, 0, 0};
      camera.width = 71;
      camera.height = 33;
      const Tensor<float> amidst = surfel_ellipses(surfels, camera, options);
      EXPECT_GT(covered(amidst, options), 0.15);
      expect_same(amidst, oracle(surfels, camera, options));
    }
  }
}

TEST(Ellipses, BearAnySurfel) {
  const Fixture f;
  const raster::Options options = with_background();
  constexpr float nan = std::numeric_limits<float>::quiet_NaN(), infinity = HUGE_VALF;
  PosedSurfels s = posed_cloud(60, 0.6F, 5);
  int64_t i = 0;
  for (const float bad : {nan, infinity, -infinity}) {
    s.position(i++, 1) = bad;
    s.scale(i++, 0) = bad;
    s.rotation(i++, 2) = bad;
    s.opacity[i++] = bad;
    s.sh(i++, 3, 1) = bad;
    s.tint[i++] = bad;
  }
  for (const float bad : {0.0F, -1.0F, 1e-44F, 1e4F, 1e20F, 3e38F}) s.scale(i++, 1) = bad;
  for (const float bad : {1e20F, -1e20F, 3e38F}) s.position(i++, 2) = bad;
  for (int64_t k = 0; k < 4; ++k) s.rotation(i, k) = 0;
  ++i;
  store3(s.position.row(i++), f.request.camera.position);
  s.opacity[i++] = 0;
  // Seen from the side: its plane holds the eye.
  store3(s.position.row(i), Vec3<float>(0, 0, 0));
  const std::array<float, 4> sideways = {std::sqrt(0.5F), 0, std::sqrt(0.5F), 0};
  std::copy(sideways.begin(), sideways.end(), s.rotation.row(i++));
  ASSERT_LE(i, s.count());
  const Tensor<float> picture = surfel_ellipses(s, f.request.camera, options);
  EXPECT_GT(covered(picture, options), 0.05);
  expect_same(picture, oracle(s, f.request.camera, options));
  for (const float v : picture.values()) ASSERT_TRUE(v >= 0 && v <= 1);
}

TEST(Ellipses, NoneAreTheBackground) {
  const Fixture f;
  const raster::Options options = with_background();
  const Tensor<float> picture = surfel_ellipses({}, f.request.camera, options);
  ASSERT_EQ(picture.shape(), (Shape{48, 64, 3}));
  EXPECT_EQ(covered(picture, options), 0);
  EXPECT_EQ(picture(3, 4, 2), 1) << "in the range of a picture";
}

TEST(Ellipses, AreTheSameAtAnyNumberOfThreads) {
  const Fixture f;
  const PosedSurfels surfels = posed_cloud(5000, 1.5F, 7);
  set_threads(1);
  const Tensor<float> one = surfel_ellipses(surfels, f.request.camera, {});
  set_threads(3);
  const Tensor<float> three = surfel_ellipses(surfels, f.request.camera, {});
  set_threads(0);
  EXPECT_TRUE(std::equal(one.values().begin(), one.values().end(), three.values().begin()));
}

TEST(Ellipses, OfTwoAtOneDepthTheFirstWins) {
  const Fixture f;
  PosedSurfels surfels = posed_cloud(1, 0, 1);
  surfels.opacity.fill(1);
  surfels.scale.fill(0.5F);
  const Tensor<float> alone = surfel_ellipses(surfels, f.request.camera, {});
  EXPECT_GT(covered(alone, {}), 0.01);
  PosedSurfels twice = posed_cloud(2, 0, 1);
  for (int64_t i = 0; i < 2; ++i) {
    twice.opacity[i] = 1;
    std::copy_n(surfels.rotation.data(), 4, twice.rotation.row(i));
    std::copy_n(surfels.sh.data(), surfels.sh.size(), twice.sh.row(i));
  }
  twice.scale.fill(0.5F);
  twice.sh(1, 0, 0) += 1;
  expect_same(surfel_ellipses(twice, f.request.camera, {}), alone);
}

TEST(Ellipses, AreDarkerAtTheirRimsAndFromTheSide) {
  const Vec3<float> colour(0.8F, 0.4F, 2);
  EXPECT_EQ(ellipse_colour(colour, 1, 0), Vec3<float>(0.8F, 0.4F, 1));
  EXPECT_LT(ellipse_colour(colour, 1, 1).x, ellipse_colour(colour, 1, 0.5).x);
  EXPECT_LT(ellipse_colour(colour, 0.2, 0).x, ellipse_colour(colour, 1, 0).x);
  EXPECT_GT(ellipse_colour(colour, 0, 1).x, 0.2F);
}

TEST(Ellipses, AreALayerOfAFrame) {
  const Fixture f;
  Renderer renderer(RenderOptions{});
  const Frame& frame = renderer.forward(f.scene, f.request);
  const Tensor<float> layer = layer_values(frame, Layer::surfels, 1);
  expect_same(layer, surfel_ellipses(frame.main, f.request.camera, renderer.options().raster_options(1)));
  EXPECT_GT(covered(layer, {}), 0.1);
}

}  // namespace
}  // namespace traceflow::viz

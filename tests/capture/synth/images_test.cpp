#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "base/parallel.h"
#include "capture/synth/scenes.h"
#include "capture/synth/synth.h"
#include "capture/synth/trace.h"

namespace traceflow {
namespace {

using synth::Vector;

SynthOptions small_options(SynthScene scene = SynthScene::balls) {
  SynthOptions options;
  options.scene = scene;
  options.frames = 9;
  options.width = 96;
  options.height = 54;
  options.samples = 4;
  options.points = 2000;
  return options;
}

template <class T>
bool same_bytes(const Tensor<T>& a, const Tensor<T>& b) {
  return a.shape() == b.shape() && std::ranges::equal(a.values(), b.values());
}

double angle_between(const Vector& a, const Vector& b) {
  return std::acos(std::clamp(dot(a, b), -1.0, 1.0)) * 180 / std::numbers::pi;
}

Vector world_point(const SynthView& view, const Tensor<float>& depth, int64_t y, int64_t x) {
  const auto& camera = view.camera;
  return camera.position + double{depth(y, x)} * camera.ray_in_world(static_cast<double>(x) + 0.5,
                                                                     static_cast<double>(y) + 0.5);
}

int body_at(const synth::Stage& stage, const SynthView& view, int64_t y, int64_t x) {
  const Vector ray = view.camera.ray_in_world(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
  const auto hit = synth::nearest_hit(stage, {view.camera.position, normalize(ray)});
  return hit ? hit->body : -1;
}

class SynthImagesOf : public testing::TestWithParam<SynthScene> {};
INSTANTIATE_TEST_SUITE_P(All, SynthImagesOf,
                         testing::Values(SynthScene::balls, SynthScene::mirror, SynthScene::tumble,
                                         SynthScene::soft));

// Whether masks show the mirrors of a scene rather than what moves in it.
bool masks_mirrors(SynthScene scene) { return scene == SynthScene::balls || scene == SynthScene::mirror; }

TEST(SynthViews, LeftTakesEveryFrameAndRightEveryNth) {
  const std::vector<SynthView> views = synth_views(small_options());
  std::string ids;
  for (const SynthView& view : views) ids += view.id + " ";
  EXPECT_EQ(
      ids,
      "000000_left 000001_left 000002_left 000002_right 000003_left 000004_left 000005_left 000006_left "
      "000006_right 000007_left 000008_left ");
  EXPECT_EQ(views.front().time, 0);
  EXPECT_EQ(views.back().time, 1);
}

TEST(SynthViews, CamerasAreRotationsThatLookAtTheObject) {
  const SynthOptions options = small_options();
  const Vector target = synth::make_scene(options.scene).arc.target;
  double widest = 0;
  const std::vector<SynthView> views = synth_views(options);
  for (const SynthView& view : views) {
    const Mat3<double>& r = view.camera.camera_from_world;
    EXPECT_NEAR(glm::determinant(r), 1, 1e-12);
    const Vector target_in_camera = view.camera.point_in_camera(target);
    EXPECT_NEAR(target_in_camera.x, 0, 1e-12);
    EXPECT_NEAR(target_in_camera.y, 0, 1e-12);
    EXPECT_GT(target_in_camera.z, 0);
    EXPECT_LT((r * Vector(0, 0, 1)).y, 0) << "world up is camera up";
    for (const SynthView& other : views) {
      widest = std::max(widest, angle_between(normalize(view.camera.position - target),
                                              normalize(other.camera.position - target)));
    }
  }
  EXPECT_GT(widest, 50);
  EXPECT_LT(widest, 90);
}

TEST_P(SynthImagesOf, SameBytesAtAnyThreadCount) {
  const SynthOptions options = small_options(GetParam());
  const SynthView view = synth_views(options)[3];
  set_threads(1);
  const SynthImages one = synth_images(options, view);
  set_threads(5);
  const SynthImages five = synth_images(options, view);
  set_threads(0);
  EXPECT_TRUE(same_bytes(one.colour, five.colour));
  EXPECT_TRUE(same_bytes(one.specular, five.specular));
  EXPECT_TRUE(same_bytes(one.depth, five.depth));
}

TEST(SynthImages, SeedChangesTheNoiseAndNotTheScene) {
  SynthOptions options = small_options();
  const SynthView view = synth_views(options)[3];
  const SynthImages a = synth_images(options, view);
  options.seed = 1;
  const SynthImages b = synth_images(options, view);
  EXPECT_FALSE(same_bytes(a.colour, b.colour));
  EXPECT_TRUE(same_bytes(a.normal, b.normal));
}

TEST_P(SynthImagesOf, ColourIsTheClippedSumOfItsParts) {
  const SynthOptions options = small_options(GetParam());
  const SynthImages images = synth_images(options, synth_views(options)[3]);
  for (int64_t i = 0; i < images.colour.size(); ++i) {
    ASSERT_NEAR(images.colour[i], std::min(1.0F, images.diffuse[i] + images.specular[i]), 1e-6F);
  }
}

TEST_P(SynthImagesOf, TruthNormalsAreThoseOfTheDepth) {
  const SynthOptions options = small_options(GetParam());
  const SynthView view = synth_views(options)[3];
  const SynthImages images = synth_images(options, view);
  const synth::Stage stage = synth::make_scene(options.scene).at(view.time);
  const auto normal = [&](int64_t y, int64_t x) { return load3<double>(&images.normal(y, x, 0)); };
  const auto same_face = [&](int64_t y, int64_t x, int64_t v, int64_t u) {
    return body_at(stage, view, y, x) == body_at(stage, view, v, u) && dot(normal(y, x), normal(v, u)) > 0.97;
  };
  int64_t compared = 0;
  double sum = 0;
  for (int64_t y = 1; y + 1 < options.height; ++y) {
    for (int64_t x = 1; x + 1 < options.width; ++x) {
      ASSERT_NEAR(length(normal(y, x)), 1, 1e-5);
      if (!same_face(y, x, y - 1, x) || !same_face(y, x, y + 1, x)) continue;
      if (!same_face(y, x, y, x - 1) || !same_face(y, x, y, x + 1)) continue;
      const Vector across =
          world_point(view, images.depth, y, x + 1) - world_point(view, images.depth, y, x - 1);
      const Vector down =
          world_point(view, images.depth, y + 1, x) - world_point(view, images.depth, y - 1, x);
      ++compared;
      const double error = angle_between(normalize(cross(down, across)), normal(y, x));
      ASSERT_LT(error, 8) << x << ' ' << y << ": the chord of a ball's rim, no more";
      sum += error;
    }
  }
  EXPECT_GT(compared, options.width * options.height / 2);
  EXPECT_LT(sum / static_cast<double>(compared), 0.2);
}

TEST_P(SynthImagesOf, MaskIsWhereTheCentreRayMeetsAMirrorOrWhatMoves) {
  const SynthOptions options = small_options(GetParam());
  const SynthView view = synth_views(options)[5];
  const SynthImages images = synth_images(options, view);
  const synth::Stage stage = synth::make_scene(options.scene).at(view.time);
  int64_t inside = 0;
  for (int64_t y = 0; y < options.height; ++y) {
    for (int64_t x = 0; x < options.width; ++x) {
      const int body = body_at(stage, view, y, x);
      ASSERT_GE(body, 0) << "the room is closed";
      const synth::Body& shown = stage.bodies[static_cast<size_t>(body)];
      const bool expected = masks_mirrors(options.scene) ? shown.material.is_specular() : shown.object >= 0;
      ASSERT_EQ(images.mask(y, x), expected ? 1 : 0);
      inside += images.mask(y, x);
    }
  }
  const double share = static_cast<double>(inside) / (options.width * options.height);
  EXPECT_GT(share, 0.10);
  EXPECT_LT(share, 0.40);
}

TEST_P(SynthImagesOf, SpecularPartLivesInTheMask) {
  const SynthOptions options = small_options(GetParam());
  const SynthImages images = synth_images(options, synth_views(options)[3]);
  for (int64_t y = 1; y + 1 < options.height; ++y) {
    for (int64_t x = 1; x + 1 < options.width; ++x) {
      int around = 0;
      for (int64_t v = y - 1; v <= y + 1; ++v) {
        for (int64_t u = x - 1; u <= x + 1; ++u) around += images.mask(v, u);
      }
      const float specular = images.specular(y, x, 0) + images.specular(y, x, 1) + images.specular(y, x, 2);
      if (around == 0) {
        ASSERT_EQ(specular, 0) << x << ' ' << y;
      }
      if (around == 9 && masks_mirrors(options.scene)) {
        ASSERT_GT(specular, 0) << x << ' ' << y;
      }
    }
  }
}

TEST_P(SynthImagesOf, PointsLieOnTheSurfaceAtTimeZero) {
  const SynthOptions options = small_options(GetParam());
  const Tensor<float> points = synth_points(options);
  ASSERT_EQ(points.dim(0), options.points);
  const SynthView view = synth_views(options).front();
  ASSERT_EQ(view.time, 0);
  const SynthImages images = synth_images(options, view);
  int visible = 0;
  int agreeing = 0;
  for (int64_t i = 0; i < points.dim(0); ++i) {
    const Vector p = view.camera.point_in_camera(load3<double>(points.row(i)));
    if (p.z <= 0) continue;
    const Vec2<double> pixel = view.camera.project(p);
    const auto x = static_cast<int64_t>(std::floor(pixel.x));
    const auto y = static_cast<int64_t>(std::floor(pixel.y));
    if (x < 1 || y < 1 || x + 1 >= options.width || y + 1 >= options.height) continue;
    float nearest = images.depth(y, x);
    float farthest = nearest;
    for (int64_t v = y - 1; v <= y + 1; ++v) {
      for (int64_t u = x - 1; u <= x + 1; ++u) {
        nearest = std::min(nearest, images.depth(v, u));
        farthest = std::max(farthest, images.depth(v, u));
      }
    }
    // A point may be hidden from this view, but it can never float in front of what is seen.
    EXPECT_GT(p.z, nearest - 0.015F);
    ++visible;
    if (p.z < farthest + 0.015F) ++agreeing;
  }
  EXPECT_GT(visible, options.points / 3);
  EXPECT_GT(agreeing, visible * 3 / 4);
}

TEST(SynthPrior, WithoutNoiseItIsTheTruthInTheViewersAxes) {
  SynthOptions options = small_options();
  options.prior_noise = 0;
  const SynthView view = synth_views(options)[1];
  const SynthImages images = synth_images(options, view);
  const Tensor<float> prior = synth_normal_prior(options, view, images.normal);
  for (int64_t i = 0; i < prior.size(); i += 3) {
    const Vector opencv(prior[i], -prior[i + 1], -prior[i + 2]);
    const Vector world = opencv * view.camera.camera_from_world;
    ASSERT_NEAR(length(world - load3<double>(images.normal.data() + i)), 0, 1e-5);
    ASSERT_NEAR(length(opencv), 1, 1e-5);
  }
}

TEST(SynthPrior, ErrorsAreThoseOfAnEstimatorAndGrowWithTheNoise) {
  SynthOptions options = small_options();
  const SynthView view = synth_views(options)[1];
  const SynthImages images = synth_images(options, view);
  options.prior_noise = 0;
  const Tensor<float> exact = synth_normal_prior(options, view, images.normal);
  double before = 0;
  for (const float noise : {0.5F, 1.0F, 2.0F}) {
    options.prior_noise = noise;
    const Tensor<float> prior = synth_normal_prior(options, view, images.normal);
    const int64_t pixels = prior.size() / 3;
    double sum = 0;
    for (int64_t i = 0; i < pixels; ++i) {
      const Vector n = load3<double>(prior.data() + 3 * i);
      ASSERT_NEAR(length(n), 1, 1e-5);
      sum += angle_between(n, load3<double>(exact.data() + 3 * i));
    }
    const double error = sum / static_cast<double>(pixels);
    EXPECT_GT(error, before);
    if (noise == 1.0F) {
      EXPECT_GT(error, 2);
      EXPECT_LT(error, 12);
    }
    before = error;
  }
  EXPECT_TRUE(same_bytes(synth_normal_prior(options, view, images.normal),
                         synth_normal_prior(options, view, images.normal)));
}

TEST(SynthPrior, InverseDepthIsThatOfTheTruthUpToScaleShiftAndErrors) {
  SynthOptions options = small_options();
  const SynthView view = synth_views(options)[1];
  const Tensor<float> depth = synth_images(options, view).depth;
  const auto [least, most] = std::ranges::minmax(depth.values());
  double before = 0;
  for (const float noise : {0.0F, 1.0F, 2.0F}) {
    options.prior_noise = noise;
    const Tensor<float> found = synth_inverse_depth(options, view, depth);
    ASSERT_EQ(found.shape(), depth.shape());
    const auto [low, high] = std::ranges::minmax(found.values());
    EXPECT_EQ(low, 0);
    EXPECT_EQ(high, 1);
    double error = 0;
    for (int64_t i = 0; i < depth.size(); ++i) {
      const double exact = (1 / depth[i] - 1 / most) / (1 / least - 1 / most);
      error += std::abs(found[i] - exact) / static_cast<double>(depth.size());
    }
    EXPECT_LT(error, noise == 0 ? 1e-6 : 0.1 * noise);
    EXPECT_GE(error, before);
    before = error;
  }
  EXPECT_GT(before, 0.01);
  EXPECT_TRUE(
      same_bytes(synth_inverse_depth(options, view, depth), synth_inverse_depth(options, view, depth)));
}

TEST(SynthOptions, ValidateNamesWhatIsWrong) {
  const auto complains = [](auto change) {
    SynthOptions options;
    change(options);
    EXPECT_THROW(options.validate(), InputError);
  };
  EXPECT_NO_THROW(SynthOptions().validate());
  complains([](SynthOptions& o) { o.frames = 0; });
  complains([](SynthOptions& o) { o.width = -1; });
  complains([](SynthOptions& o) { o.height = 100000; });
  complains([](SynthOptions& o) { o.samples = 0; });
  complains([](SynthOptions& o) { o.test_every = 0; });
  complains([](SynthOptions& o) { o.prior_noise = std::nanf(""); });
  complains([](SynthOptions& o) { o.points = -1; });
}

}  // namespace
}  // namespace traceflow

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "base/parallel.h"
#include "base/random.h"
#include "capture/synth/motion_case.h"

namespace traceflow {
namespace {

using synth::Vector;

// A right-handed frame of three of the points that are far apart.
Mat3<double> frame_of(const SynthMotion& motion, int64_t frame, const std::array<int64_t, 3>& corners) {
  const Vector a = point_at(motion, frame, corners[0]);
  const Vector x = normalize(point_at(motion, frame, corners[1]) - a);
  const Vector z = normalize(cross(x, point_at(motion, frame, corners[2]) - a));
  return {x, cross(z, x), z};
}

std::array<int64_t, 3> far_apart(const SynthMotion& motion, const std::vector<int64_t>& points) {
  const auto farthest = [&](auto measure) { return *std::ranges::max_element(points, {}, measure); };
  const Vector a = point_at(motion, 0, points[0]);
  const int64_t second = farthest([&](int64_t i) { return length(point_at(motion, 0, i) - a); });
  const Vector along = point_at(motion, 0, second) - a;
  const int64_t third = farthest([&](int64_t i) { return length(cross(along, point_at(motion, 0, i) - a)); });
  return {points[0], second, third};
}

double turn_in_degrees(const SynthMotion& motion, int64_t frame, const std::array<int64_t, 3>& corners) {
  const Mat3<double> turn = frame_of(motion, frame, corners) * glm::transpose(frame_of(motion, 0, corners));
  const double cosine = 0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1);
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

class SynthMotionOf : public testing::TestWithParam<SynthScene> {};
INSTANTIATE_TEST_SUITE_P(All, SynthMotionOf,
                         testing::Values(SynthScene::balls, SynthScene::mirror, SynthScene::tumble,
                                         SynthScene::soft));

TEST_P(SynthMotionOf, EveryObjectHasPoints) {
  const SynthOptions options = motion_options(GetParam());
  const SynthMotion motion = synth_motion(options);
  ASSERT_EQ(motion.points.shape(), Shape({options.frames, motion.object.size(), 3}));
  EXPECT_LE(motion.object.size(), 2000);
  const std::map<SynthScene, int> expected{
      {SynthScene::balls, 3}, {SynthScene::mirror, 3}, {SynthScene::tumble, 2}, {SynthScene::soft, 1}};
  const auto objects = points_of(motion);
  ASSERT_EQ(static_cast<int>(objects.size()), expected.at(GetParam()));
  EXPECT_EQ(objects.begin()->first, 0);
  EXPECT_EQ(objects.rbegin()->first, expected.at(GetParam()) - 1);
  for (const auto& [object, points] : objects) {
    EXPECT_GE(points.size(), 50U) << object;
    double moved = 0;
    for (int64_t frame = 0; frame < options.frames; ++frame)
      moved = std::max(moved, length(point_at(motion, frame, points[0]) - point_at(motion, 0, points[0])));
    EXPECT_GT(moved, 0.005) << object << " never moves";
  }
}

TEST_P(SynthMotionOf, DependsOnTheSceneAloneAndNotOnThreadsSeedOrPictures) {
  SynthOptions options = motion_options(GetParam());
  set_threads(1);
  const SynthMotion one = synth_motion(options);
  set_threads(5);
  options.seed = 9;
  options.width *= 4;
  options.height *= 4;
  options.points = 3;
  const SynthMotion other = synth_motion(options);
  set_threads(0);
  ASSERT_TRUE(std::ranges::equal(one.object.values(), other.object.values()));
  for (int64_t i = 0; i < one.points.size(); ++i) ASSERT_NEAR(one.points[i], other.points[i], 1e-6);
  options = motion_options(GetParam());
  EXPECT_TRUE(std::ranges::equal(one.points.values(), synth_motion(options).points.values()));
}

TEST_P(SynthMotionOf, AtTimeZeroPointsLieOnTheDepthOfTheFirstView) {
  SynthOptions options = motion_options(GetParam());
  options.width = 480;  // one ray of the motion to each pixel
  options.height = 270;
  options.frames = 2;
  const SynthView view = synth_views(options).front();
  const SynthImages images = synth_images(options, view);
  const SynthMotion motion = synth_motion(options);
  for (int64_t i = 0; i < motion.object.size(); ++i) {
    const Vector in_camera = view.camera.point_in_camera(point_at(motion, 0, i));
    const Vec2<double> pixel = view.camera.project(in_camera);
    const auto x = static_cast<int64_t>(std::floor(pixel.x));
    const auto y = static_cast<int64_t>(std::floor(pixel.y));
    ASSERT_NEAR(pixel.x, static_cast<double>(x) + 0.5, 1e-3);
    ASSERT_NEAR(pixel.y, static_cast<double>(y) + 0.5, 1e-3);
    ASSERT_NEAR(in_camera.z, images.depth(y, x), 1e-6);
    if (GetParam() == SynthScene::tumble || GetParam() == SynthScene::soft) {
      ASSERT_EQ(images.mask(y, x), 1);
    }
  }
}

TEST_P(SynthMotionOf, TextureSticksToThePoints) {
  const SynthOptions options = motion_options(GetParam());
  const SynthMotion motion = synth_motion(options);
  const synth::AnimatedScene scene = synth::make_scene(options.scene);
  const std::vector<SynthView> views = training_views(options);
  std::vector<Vector> at_first;
  int64_t seen = 0;
  int64_t same = 0;
  double spread = 0;
  for (const SynthView& view : views) {
    const synth::Stage stage = scene.at(view.time);
    for (int64_t i = 0; i < motion.object.size(); ++i) {
      const auto hit = seen_at(stage, view, point_at(motion, view.frame, i));
      if (view.frame == 0) {
        ASSERT_TRUE(hit) << i;
      }
      if (!hit) continue;
      const synth::Body& body = stage.bodies[static_cast<size_t>(hit->body)];
      ASSERT_EQ(body.object, motion.object[i]);
      const Vector colour = synth::colour_at(body.material.albedo, hit->uv, hit->rest);
      if (view.frame == 0) at_first.push_back(colour);
      const double error = length(colour - at_first[static_cast<size_t>(i)]);
      ++seen;
      same += error < 1e-4 ? 1 : 0;
      spread = std::max(spread, length(colour - at_first[0]));
    }
  }
  EXPECT_GT(seen, motion.object.size() * options.frames / 3);
  // Rounding carries a point over a border of the pattern now and then.
  EXPECT_GT(static_cast<double>(same), 0.998 * static_cast<double>(seen));
  EXPECT_GT(spread, 0.3) << "there is a texture that could have slipped";
}

class SynthRigidMotion : public testing::TestWithParam<SynthScene> {};
INSTANTIATE_TEST_SUITE_P(AllButSoft, SynthRigidMotion,
                         testing::Values(SynthScene::balls, SynthScene::mirror, SynthScene::tumble));

TEST_P(SynthRigidMotion, ObjectsKeepTheirDistances) {
  const SynthOptions options = motion_options(GetParam());
  const SynthMotion motion = synth_motion(options);
  Random random(1);
  for (const auto& [object, points] : points_of(motion)) {
    for (int k = 0; k < 300; ++k) {
      const int64_t i = points[static_cast<size_t>(random.below(static_cast<int64_t>(points.size())))];
      const int64_t j = points[static_cast<size_t>(random.below(static_cast<int64_t>(points.size())))];
      const double at_first = length(point_at(motion, 0, i) - point_at(motion, 0, j));
      for (int64_t frame = 1; frame < options.frames; ++frame) {
        const double now = length(point_at(motion, frame, i) - point_at(motion, frame, j));
        ASSERT_NEAR(now, at_first, 1e-6) << "object " << object << ", frame " << frame;
      }
    }
  }
}

TEST(SynthMotion, TumbleTurnsByAboutAQuarterAndMovesByAThirdOfTheDistance) {
  const SynthOptions options = motion_options(SynthScene::tumble);
  const SynthMotion motion = synth_motion(options);
  const SynthView first = synth_views(options).front();
  const synth::AnimatedScene scene = synth::make_scene(options.scene);
  for (const auto& [object, points] : points_of(motion)) {
    const std::array<int64_t, 3> corners = far_apart(motion, points);
    double most = 0;
    for (int64_t frame = 1; frame < options.frames; ++frame)
      most = std::max(most, turn_in_degrees(motion, frame, corners));
    EXPECT_GT(turn_in_degrees(motion, options.frames - 1, corners), 60) << object;
    EXPECT_LT(most, 120) << object;

    // How far the thing's middle goes, by the points' motion and by the pose.
    const auto middle_at = [&scene, of = object](double time) {
      const synth::Stage stage = scene.at(time);
      return std::ranges::find(stage.bodies, of, &synth::Body::object)->pose.position;
    };
    const int64_t last = options.frames - 1;
    const Mat3<double> turn = frame_of(motion, last, corners) * glm::transpose(frame_of(motion, 0, corners));
    const Vector begin = middle_at(0);
    const Vector end = point_at(motion, last, corners[0]) + turn * (begin - point_at(motion, 0, corners[0]));
    EXPECT_LT(length(end - middle_at(1)), 1e-5) << object;
    const double share = length(end - begin) / length(begin - first.camera.position);
    EXPECT_NEAR(share, 1.0 / 3, 0.04) << object;
  }
}

TEST(SynthMotion, SoftStretchesByAFifthAndComesBack) {
  const SynthOptions options = motion_options(SynthScene::soft);
  const SynthMotion motion = synth_motion(options);
  double most = 0;
  double least = 10;
  double upright = 0;
  for (int64_t i = 0; i < motion.object.size(); ++i) {
    for (int64_t j = 0; j < i; ++j) {
      const Vector apart = point_at(motion, 0, i) - point_at(motion, 0, j);
      const double before = length(apart);
      if (before < 0.02 || before > 0.05) continue;
      for (int64_t frame = 0; frame < options.frames; ++frame) {
        const double ratio = length(point_at(motion, frame, i) - point_at(motion, frame, j)) / before;
        most = std::max(most, ratio);
        least = std::min(least, ratio);
        if (frame == options.frames / 2 && std::abs(apart.z) > 0.99 * before)
          upright = std::max(upright, ratio);
      }
      ASSERT_NEAR(length(point_at(motion, options.frames - 1, i) - point_at(motion, options.frames - 1, j)),
                  before, 1e-6);
    }
  }
  EXPECT_NEAR(upright, 1.2, 0.01) << "half-way, when it stands straight";
  EXPECT_GT(most, 1.15);
  EXPECT_LT(most, 1.25);
  EXPECT_GT(least, 0.75);
  EXPECT_LT(least, 0.95) << "it bends, so the inner side gets shorter";
}

}  // namespace
}  // namespace traceflow

#include "track/photo_alignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "math/rotation_group.h"
#include "track/ball_body.h"
#include "track/pose_solver.h"

namespace traceflow {
namespace {

using ball_body::ball, ball_body::centre, ball_body::picture_of, ball_body::radius, ball_body::turned_by;

const Vec3<double> turned_since(0.03, 0.09, -0.02);

// A ball with a pattern that is a few pixels wide.
Surfels patterned_ball() {
  Surfels s = ball();
  s.log_scale.fill(std::log(0.03F));
  for (int64_t i = 0; i < s.count(); ++i) {
    const Vec3<double> x = load3<double>(s.position.row(i)) - centre;
    const double wave = std::sin(35 * x.x) + std::sin(35 * x.y + 1) + std::sin(35 * x.z + 2);
    ball_body::paint(Vec3<double>(0.5 + 0.15 * wave, 0.5 - 0.1 * wave, 0.4), s.sh.row(i));
  }
  return s;
}

DetailPhoto photo_of(const TrackTarget& picture) {
  return detail_of({picture.camera, picture.colour, picture.coverage});
}

// The ball at rest, to be compared with the photograph of the ball where it has been turned.
Alignment alignment_of(const Surfels& surfels, const LooseTurns& loose) {
  const TrackTarget rest = picture_of(surfels, Vec3<double>(0), false);
  const Motion still = turned_by(Vec3<double>(0));
  return {std::make_shared<const DetailPhoto>(photo_of(picture_of(surfels, turned_since, false))),
          detail_samples(photo_of(rest), draw_bodies(rest.camera, still, 0, surfels, {}), still, 0, loose),
          1};
}

// What is beside the mask does not show in the detail inside.
TEST(PhotoAlignment, DetailIsOfTheMaskAlone) {
  const TrackTarget picture = picture_of(patterned_ball(), Vec3<double>(0), false);
  for (const double blur : {0.0, 2.0}) {
    std::vector<DetailPhoto> photos;
    for (const float beside : {0.0F, 0.8F}) {
      Tensor<float> colour = picture.colour, coverage(picture.coverage.shape());
      for (int64_t i = 0; i < coverage.size(); ++i) {
        coverage[i] = picture.mask[i];
        for (int64_t c = 0; c < 3 && picture.mask[i] == 0; ++c) colour[3 * i + c] = beside;
      }
      photos.push_back(detail_of({picture.camera, colour, coverage}, blur));
    }
    for (int64_t i = 0; i < photos[0].detail.size(); ++i) {
      if (photos[0].mask[i / 3] == 0) continue;
      ASSERT_FLOAT_EQ(photos[0].detail[i], photos[1].detail[i]);
    }
  }
}

// A highlight is left out as if the mask did not cover it; where much is clipped, all is kept.
TEST(PhotoAlignment, HighlightsAreLeftOut) {
  const TrackTarget picture = picture_of(patterned_ball(), Vec3<double>(0), false);
  const auto with_highlight = [&](int64_t size) {
    TrackTarget bright = picture;
    for (int64_t y = 32 - size; y < 32 + size; ++y) {
      for (int64_t x = 28 - size; x < 28 + size; ++x) std::fill_n(&bright.colour(y, x, 0), 3, 1.0F);
    }
    return bright;
  };
  TrackTarget without = with_highlight(3);
  for (int64_t y = 27; y < 37; ++y) {
    for (int64_t x = 23; x < 33; ++x) without.coverage(y, x) = 0;
  }
  const DetailPhoto left_out = photo_of(with_highlight(3)), expected = photo_of(without);
  for (int64_t i = 0; i < expected.mask.size(); ++i) {
    ASSERT_EQ(left_out.mask[i], expected.mask[i]);
    for (int64_t c = 0; c < 3 && expected.mask[i] != 0; ++c)
      ASSERT_EQ(left_out.detail[3 * i + c], expected.detail[3 * i + c]);
  }
  EXPECT_EQ(expected.mask(32, 28), 0);
  EXPECT_NE(photo_of(with_highlight(12)).mask(32, 28), 0);
}

// A cropped photograph shows the same where a ray meets it.
TEST(PhotoAlignment, CroppedPhotosShowTheSame) {
  TrackTarget picture = picture_of(patterned_ball(), Vec3<double>(0), false);
  for (int64_t i = 0; i < 20 * picture.camera.width; ++i) picture.coverage[i] = 0;
  const DetailPhoto whole = photo_of(picture), part = cropped(whole);
  EXPECT_LT(part.detail.size(), whole.detail.size());
  const Camera<double> of_whole = convert<double>(whole.camera), of_part = convert<double>(part.camera);
  int seen = 0;
  for (double x = -0.6; x < 0.6; x += 0.05) {
    for (double y = -0.6; y < 0.6; y += 0.05) {
      const Vec3<double> in_camera = of_whole.point_in_camera(centre + Vec3<double>(x, y, -0.3));
      const Vec2<double> at = of_whole.project(in_camera), cut = of_part.project(in_camera);
      const auto a = sample_at(whole, at.x, at.y), b = sample_at(part, cut.x, cut.y);
      ASSERT_EQ(a.has_value(), b.has_value());
      if (!a) continue;
      ++seen;
      ASSERT_LT(glm::length(a->value - b->value), 1e-5);
      ASSERT_LT(glm::length(a->by_x - b->by_x) + glm::length(a->by_y - b->by_y), 1e-5);
    }
  }
  EXPECT_GT(seen, 100);
}

TEST(PhotoAlignment, SamplesLieOnTheBallAndFaceOutwards) {
  const Surfels surfels = patterned_ball();
  const Alignment alignment = alignment_of(surfels, {Mat3<double>(1)});
  ASSERT_GT(alignment.samples.size(), 800U);
  double off = 0, turned = 0;
  for (const DetailSample& sample : alignment.samples) {
    const Vec3<double> arm = Vec3<double>(sample.rest.position) - centre;
    off += std::abs(glm::length(arm) / radius - 1);
    turned += 1 - dot(normalize(arm), Vec3<double>(sample.rest.normal));
  }
  const auto count = static_cast<double>(alignment.samples.size());
  EXPECT_LT(off, 0.02 * count);
  EXPECT_LT(turned, 0.01 * count);
  EXPECT_TRUE(alignment_of(surfels, {Mat3<double>(0)}).samples.empty());
}

TEST(PhotoAlignment, TheEquationsHoldTheCostsDerivative) {
  const Surfels surfels = patterned_ball();
  const LooseTurns loose{Mat3<double>(1)};
  const Alignment alignment = alignment_of(surfels, loose);
  const Vec3<double> at = 0.5 * turned_since;
  NormalEquations equations(6);
  const double cost = align(alignment, turned_by(at), 0, loose, &equations);
  EXPECT_DOUBLE_EQ(cost, align(alignment, turned_by(at), 0, loose, nullptr));
  constexpr double step = 2e-4;
  double size = 0, off = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto moved = [&](double by) {
      Vec3<double> turn(0);
      turn[axis] = by;
      const Vec4<double> q = quaternion_product(quaternion_exp(turn), quaternion_exp(at));
      return align(alignment, turned_by(quaternion_log(q)), 0, loose, nullptr);
    };
    const double expected = -(moved(step) - moved(-step)) / (2 * step);
    const double found = equations.b[static_cast<size_t>(axis)];
    size = std::max(size, std::abs(expected));
    off = std::max(off, std::abs(found - expected));
  }
  EXPECT_GT(size, 1);
  EXPECT_LT(off, 0.03 * size);
}

// As many samples again that the photograph does not show make the cost twice as large, and so its
// derivatives.
TEST(PhotoAlignment, WhatIsHiddenCountsAsWhatIsSeen) {
  const LooseTurns loose{Mat3<double>(1)};
  const Motion there = turned_by(Vec3<double>(0));
  Alignment alignment = alignment_of(patterned_ball(), loose);
  std::erase_if(alignment.samples, [&](const DetailSample& sample) {
    return length(Vec2<float>(sample.rest.position.x, sample.rest.position.y)) > 0.7 * radius;
  });
  NormalEquations seen(6), both(6);
  const double cost = align(alignment, there, 0, loose, &seen);
  const size_t count = alignment.samples.size();
  ASSERT_GT(count, 200U);
  for (size_t i = 0; i < count; ++i) {
    DetailSample behind = alignment.samples[i];
    behind.rest.normal = -behind.rest.normal;
    alignment.samples.push_back(behind);
  }
  EXPECT_NEAR(align(alignment, there, 0, loose, &both), 2 * cost, 1e-9 * cost);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(both.b[i], 2 * seen.b[i], 1e-9 * std::abs(seen.b[i]));
}

// Neither silhouettes nor normals tell how a ball has turned. Its photographs do, and where they are not
// compared it is left as it was.
TEST(PhotoAlignment, FindsHowABallHasTurned) {
  const Surfels surfels = patterned_ball();
  const LooseTurns loose{Mat3<double>(1)};
  for (const bool compares : {false, true}) {
    Motion motion = turned_by(Vec3<double>(0));
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, turned_since, false)});
    solver.loosen(loose, loose);
    if (compares) solver.compare(alignment_of(surfels, loose));
    solver.solve({0.5F, 0.3F, {0.0F}}, {8, 1});
    const Vec3<double> found = quaternion_log(unit_quaternion(load4<double>(&motion.rotation(0, 0, 0))));
    const Vec3<double> expected = compares ? turned_since : Vec3<double>(0);
    EXPECT_LT(glm::length(found - expected), compares ? 0.05 * glm::length(turned_since) : 1e-6) << compares;
  }
}

}  // namespace
}  // namespace traceflow

#include "track/new_surface.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "math/rotation.h"
#include "scene/rows.h"
#include "track/ball_body.h"

namespace traceflow {
namespace {

using ball_body::ball, ball_body::centre, ball_body::picture_of, ball_body::radius, ball_body::turned_by;

const Vec3<double> turn(0.1, 0.6, -0.2);

// The half of the ball that its camera sees before the turn.
Surfels part_of_ball() {
  const Surfels whole = ball();
  RowEdit edit;
  for (int64_t i = 0; i < whole.count(); ++i) {
    if (whole.position(i, 2) < centre.z) edit.keep(i);
  }
  return edited_rows(whole, PlacedEdit(edit, Device::cpu));
}

// Pixels inside the mask that no surfel covers.
int64_t uncovered_pixels(const Surfels& surfels, const TrackTarget& target) {
  const Tensor<float> covered = picture_of(surfels, turn, false).coverage;
  const Tensor<float>& mask = target.coverage;
  int64_t count = 0;
  for (int64_t y = 1; y + 1 < mask.dim(0); ++y) {
    for (int64_t x = 1; x + 1 < mask.dim(1); ++x) {
      const float least =
          std::min({mask(y, x), mask(y - 1, x), mask(y + 1, x), mask(y, x - 1), mask(y, x + 1)});
      count += least > 0.95F && covered(y, x) < 0.5F ? 1 : 0;
    }
  }
  return count;
}

Surfels made_for(const Surfels& surfels, const TrackTarget& target, int64_t limit = 1000) {
  return new_surface(target, turned_by(turn), 0, surfels, {}, 0.5F, limit);
}

// What has come into view lies on the ball, faces outwards, is as large as it should be, and covers what was
// bare.
TEST(NewSurface, GoesOnWhereABodyEnds) {
  const Surfels part = part_of_ball();
  TrackTarget target = picture_of(ball(), turn, false);
  const int64_t before = uncovered_pixels(part, target);
  ASSERT_GT(before, 20);
  for (const bool has_prior : {true, false}) {
    if (!has_prior) target.normal_prior = {};
    const Surfels made = made_for(part, target);
    EXPECT_GE(made.count(), before - 2);
    double off = 0, turned = 0;
    for (int64_t i = 0; i < made.count(); ++i) {
      const Vec3<double> arm = load3<double>(made.position.row(i)) - centre;
      off = std::max(off, std::abs(length(arm) - radius));
      const Mat3<double> axes =
          rotation_from_quaternion(unit_quaternion(load4<double>(made.rotation.row(i))));
      turned = std::max(turned, std::acos(std::min(1.0, dot(axes[2], normalize(arm)))));
      EXPECT_EQ(made.body[i], 0);
    }
    EXPECT_LT(off, (has_prior ? 0.05 : 0.3) * radius);
    EXPECT_LT(turned, has_prior ? 0.3 : 1.2);
    Surfels both = part;
    append_rows(both, made);
    EXPECT_LT(uncovered_pixels(both, target), before / 10);
  }
}

TEST(NewSurface, BeginsWithThePixelsColour) {
  const TrackTarget target = picture_of(ball(), turn, false);
  Surfels both = part_of_ball();
  append_rows(both, made_for(both, target));
  const TrackTarget after = picture_of(both, turn, false);
  double off = 0, count = 0;
  for (int64_t i = 0; i < target.coverage.size(); ++i) {
    if (target.coverage[i] < 0.99F || after.coverage[i] < 0.9F) continue;
    off += std::abs(target.colour[3 * i] - after.colour[3 * i]);
    ++count;
  }
  EXPECT_LT(off / count, 0.03);
}

TEST(NewSurface, IsNoneWhereAllIsCoveredOrNoMaskIs) {
  TrackTarget target = picture_of(ball(), turn, false);
  EXPECT_EQ(made_for(ball(), target).count(), 0);
  const Surfels part = part_of_ball();
  target.coverage.zero();
  target.mask.zero();
  EXPECT_EQ(made_for(part, target).count(), 0);
}

// Surfels that fill a rim stick out of the mask; the pose is what brings such a body nearer.
TEST(NewSurface, IsNoneAroundABodyThatIsTooFarAway) {
  const TrackTarget target = picture_of(ball(), turn, false);
  Surfels small = ball();
  for (int64_t i = 0; i < small.count(); ++i)
    store3(small.position.row(i), centre + 0.94 * (load3<double>(small.position.row(i)) - centre));
  const Tensor<float> covered = picture_of(small, turn, false).coverage;
  int64_t rim = 0;
  for (int64_t i = 0; i < covered.size(); ++i) rim += target.coverage[i] > 0.95F && covered[i] < 0.5F ? 1 : 0;
  ASSERT_GT(rim, 20);
  EXPECT_EQ(made_for(small, target).count(), 0);
}

// What is there and does not show is not added again.
TEST(NewSurface, IsNoneWhereSurfelsAreFaint) {
  Surfels faint = ball();
  faint.opacity_logit.fill(-3);
  EXPECT_EQ(made_for(faint, picture_of(ball(), turn, false)).count(), 0);
}

TEST(NewSurface, KeepsToItsLimitNearestFirst) {
  const TrackTarget target = picture_of(ball(), turn, false);
  const Surfels part = part_of_ball();
  const Surfels all = made_for(part, target), few = made_for(part, target, 10);
  ASSERT_EQ(few.count(), 10);
  EXPECT_TRUE(std::equal(few.position.values().begin(), few.position.values().end(), all.position.data()));
  EXPECT_EQ(made_for(part, target, 0).count(), 0);
}

}  // namespace
}  // namespace traceflow

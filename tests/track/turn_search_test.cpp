#include "track/turn_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "track/ball_body.h"

namespace traceflow {
namespace {

using ball_body::picture_of, ball_body::turned_by;

// Surfels without gaps between them.
Surfels solid_ball() {
  Surfels s = ball_body::ball();
  s.log_scale.fill(std::log(0.03F));
  return s;
}

// A ball with wide stripes from pole to pole.
Surfels striped_ball() {
  Surfels s = solid_ball();
  for (int64_t i = 0; i < s.count(); ++i) {
    const Vec3<double> x = load3<double>(s.position.row(i)) - ball_body::centre;
    const double stripe = std::tanh(4 * std::sin(4 * std::atan2(x.x, x.z)));
    ball_body::paint(Vec3<double>(0.5 + 0.25 * stripe, 0.5, 0.5 - 0.2 * stripe), s.sh.row(i));
  }
  return s;
}

// What a glaze shows, finer than the stripes. It stays where it is when the ball turns.
Surfels mirrored() {
  Surfels s = solid_ball();
  for (int64_t i = 0; i < s.count(); ++i) {
    const Vec3<double> x = load3<double>(s.position.row(i)) - ball_body::centre;
    ball_body::paint(Vec3<double>(0.5 + 0.15 * std::sin(35 * x.x) * std::sin(35 * x.y)), s.sh.row(i));
  }
  return s;
}

DetailPhoto glazed(const Vec3<double>& turn) {
  const TrackTarget texture = picture_of(striped_ball(), turn, false),
                    glaze = picture_of(mirrored(), Vec3<double>(0), false);
  Tensor<float> colour = texture.colour;
  for (int64_t i = 0; i < colour.size(); ++i) colour[i] = 0.7F * colour[i] + 0.3F * glaze.colour[i];
  return detail_of({texture.camera, colour, texture.coverage});
}

Alignment alignment_to(const Vec3<double>& turn, const LooseTurns& loose) {
  const Surfels ball = striped_ball();
  const Motion still = turned_by(Vec3<double>(0));
  const DetailPhoto rest = glazed(Vec3<double>(0));
  return {std::make_shared<const DetailPhoto>(glazed(turn)),
          detail_samples(rest, draw_bodies(rest.camera, still, 0, ball, {}), still, 0, loose)};
}

// The turn of the stripes is found although the ball stands where the glaze says.
TEST(TurnSearch, FindsStripesUnderAGlaze) {
  const LooseTurns loose{Mat3<double>(1)};
  for (const Vec3<double>& turn : {Vec3<double>(0, 0, 0.33), Vec3<double>(0.1, 0, -0.3)}) {
    const Alignment alignment = alignment_to(turn, loose);
    const std::optional<Vec3<double>> found = seek_turn(alignment, turned_by(Vec3<double>(0)), 0, 0, loose);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(glm::length(*found - turn), 0.06);
  }
}

TEST(TurnSearch, LeavesWhatStandsRight) {
  const LooseTurns loose{Mat3<double>(1)};
  const Vec3<double> turn(0.05, -0.1, 0.3);
  EXPECT_FALSE(seek_turn(alignment_to(turn, loose), turned_by(turn), 0, 0, loose).has_value());
}

// Of a bottle, say, turns about its axis alone are sought.
TEST(TurnSearch, KeepsToTheLooseAxis) {
  const Vec3<double> axis(0, 0, 1), turn(0, 0, 0.33);
  const LooseTurns loose{outerProduct(axis, axis)};
  const std::optional<Vec3<double>> found =
      seek_turn(alignment_to(turn, loose), turned_by(Vec3<double>(0)), 0, 0, loose);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT(glm::length(*found - turn), 0.03);
  EXPECT_EQ(found->x, 0);
  EXPECT_EQ(found->y, 0);
}

TEST(TurnSearch, SpreadsATurnEvenly) {
  Motion motion = still_motion(Tensor<float>({1, 3}), Tensor<float>({6}));
  const Vec3<double> turn(0.2, -0.4, 0.1);
  spread_turn(0, 1, 4, turn, motion);
  for (int64_t key = 0; key < 6; ++key) {
    const double share = key > 4 ? 0 : std::max<double>(0, static_cast<double>(key - 1) / 3);
    const Vec3<double> now = quaternion_log(load4<double>(&motion.rotation(0, key, 0)));
    EXPECT_LT(glm::length(now - share * turn), 1e-6) << key;
  }
}

}  // namespace
}  // namespace traceflow

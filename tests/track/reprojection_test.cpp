#include "track/reprojection.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/rotation.h"
#include "math/rotation_group.h"
#include "track/ball_body.h"

namespace traceflow {
namespace {

using ball_body::ball, ball_body::centre, ball_body::picture_of, ball_body::radius, ball_body::turned_by;

const Vec3<double> has_turned(0.05, 0.12, -0.04), has_shifted(0.02, -0.015, 0.03);

Motion moved_by(const Vec3<double>& turn, const Vec3<double>& shift) {
  Motion motion = turned_by(turn);
  store3(&motion.shift(0, 0, 0), shift);
  return motion;
}

// Points on the side of the ball that the camera sees: in view 0 at rest, in view 1 where it has moved. Every
// `lost_every`-th is lost in view 1, and is said to be somewhere else.
PointTracks tracks_of_ball(int64_t lost_every) {
  constexpr int64_t count = 120;
  PointTracks tracks{Tensor<float>({2, count, 2}), Tensor<uint8_t>({2, count})};
  tracks.seen.fill(1);
  const Mat3<double> rotation = rotation_from_quaternion(quaternion_exp(has_turned));
  for (int64_t n = 0; n < count; ++n) {
    const double z = -1 + 0.6 * (static_cast<double>(n) + 0.5) / count;  // towards the camera
    const double around = 2.399963 * static_cast<double>(n), wide = std::sqrt(1 - z * z);
    const Vec3<double> arm = radius * Vec3<double>(wide * std::cos(around), wide * std::sin(around), z);
    for (int64_t view = 0; view < 2; ++view) {
      Vec3<double> point = view == 0 ? centre + arm : centre + rotation * arm + has_shifted;
      if (view == 1 && lost_every > 0 && n % lost_every == 0) point += Vec3<double>(0.2, 0.1, 0);
      tracks.direction(view, n, 0) = static_cast<float>(point.x / point.z);
      tracks.direction(view, n, 1) = static_cast<float>(point.y / point.z);
    }
  }
  return tracks;
}

// Without holes.
Surfels closed_ball() {
  Surfels s = ball();
  s.log_scale.fill(std::log(0.03F));
  return s;
}

Reprojection reprojection_of(const PointTracks& tracks) {
  const Surfels surfels = closed_ball();
  const Camera<float> camera = picture_of(surfels, Vec3<double>(0), false).camera;
  const Motion still = turned_by(Vec3<double>(0));
  return {camera, tracked_points(tracks, 0, 1, draw_bodies(camera, still, 0, surfels, {}), still, 0, camera),
          1};
}

TEST(Reprojection, PointsLieOnTheBallAndAreSeenInBothViews) {
  PointTracks tracks = tracks_of_ball(0);
  const size_t all = reprojection_of(tracks).points.size();
  EXPECT_GT(all, 100U);
  double off = 0;
  for (const TrackedPoint& point : reprojection_of(tracks).points)
    off += std::abs(glm::length(Vec3<double>(point.rest.position) - centre) / radius - 1);
  EXPECT_LT(off, 0.03 * static_cast<double>(all));
  tracks.seen(0, 60) = 0;
  tracks.seen(1, 70) = 0;
  EXPECT_EQ(reprojection_of(tracks).points.size(), all - 2);
}

TEST(Reprojection, TheEquationsHoldTheCostsDerivative) {
  const Reprojection reprojection = reprojection_of(tracks_of_ball(7));
  const std::vector<TrackedPart> parts{{Mat3<double>(1), true}};
  NormalEquations equations(6);
  const double cost = reproject(reprojection, moved_by({}, {}), 0, parts, &equations);
  EXPECT_DOUBLE_EQ(cost, reproject(reprojection, moved_by({}, {}), 0, parts, nullptr));
  constexpr double step = 1e-3;
  for (int p = 0; p < 6; ++p) {
    const auto moved = [&](double by) {
      Vec3<double> turn(0), shift(0);
      (p < 3 ? turn : shift)[p % 3] = by;
      return reproject(reprojection, moved_by(turn, shift), 0, parts, nullptr);
    };
    const double expected = -(moved(step) - moved(-step)) / (2 * step);
    EXPECT_NEAR(equations.b[static_cast<size_t>(p)], expected, 0.01 * std::abs(expected) + 1) << p;
    EXPECT_GT(equations.a[static_cast<size_t>(7 * p)], 0) << p;
  }
}

// A part of the body's numbers leaves the others as they are.
TEST(Reprojection, WhatTracksDoNotDecideStays) {
  const Reprojection reprojection = reprojection_of(tracks_of_ball(0));
  NormalEquations equations(6);
  const Vec3<double> axis(0, 1, 0);
  reproject(reprojection, moved_by({}, {}), 0, {{outerProduct(axis, axis), false}}, &equations);
  for (size_t p = 0; p < 6; ++p) {
    if (p == 1)
      EXPECT_GT(std::abs(equations.b[p]), 1);
    else
      EXPECT_EQ(equations.b[p], 0) << p;
  }
  NormalEquations none(6);
  EXPECT_EQ(reproject(reprojection, moved_by({}, {}), 0, {{}}, &none), 0);
  EXPECT_EQ(none.b, std::vector<double>(6));
}

// Neither silhouettes nor normals tell how a ball has turned. Tracks do, also where every fifth is lost.
TEST(Reprojection, FindsHowABallHasMoved) {
  const Surfels surfels = closed_ball();
  for (const int64_t lost_every : {0, 5}) {
    Motion motion = turned_by(Vec3<double>(0));
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, Vec3<double>(0), false)});
    solver.compare(reprojection_of(tracks_of_ball(lost_every)));
    solver.solve({0, 0, {0.0F}, {true}}, {8, 1});
    const Vec3<double> turn = quaternion_log(unit_quaternion(load4<double>(&motion.rotation(0, 0, 0))));
    EXPECT_LT(glm::length(turn - has_turned), 0.1 * glm::length(has_turned)) << lost_every;
    EXPECT_LT(glm::length(load3<double>(&motion.shift(0, 0, 0)) - has_shifted),
              0.1 * glm::length(has_shifted))
        << lost_every;
  }
}

// From where the ball has been found, tracks of its texture turn it no further, and tracks of what it mirrors
// turn it back.
TEST(Reprojection, TracksOfAMirrorTakeTurnsBack) {
  const Surfels surfels = closed_ball();
  const auto turn_by_tracks = [&](PointTracks tracks, bool mirrors) {
    for (int64_t i = 0; mirrors && i < tracks.direction.size() / 2; ++i)
      tracks.direction[tracks.direction.size() / 2 + i] = tracks.direction[i];
    Motion motion = mirrors ? turned_by(has_turned) : moved_by(has_turned, has_shifted);
    PoseSolver solver(surfels, nullptr, motion, 0, {}, {picture_of(surfels, has_turned, false)});
    solver.compare(reprojection_of(tracks));
    return solver.turns_by_tracks()[0];
  };
  EXPECT_LT(glm::length(turn_by_tracks(tracks_of_ball(0), false)), 0.1 * glm::length(has_turned));
  EXPECT_LT(glm::length(turn_by_tracks(tracks_of_ball(0), true) + has_turned), 0.1 * glm::length(has_turned));
}

}  // namespace
}  // namespace traceflow

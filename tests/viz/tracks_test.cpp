#include "viz/tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/parallel.h"
#include "viz/moving_board.h"

namespace traceflow::viz {
namespace {

using testing::ElementsAre;
using testing::FloatNear;

std::vector<int32_t> rows_of(const TrackFollower& follower) {
  const Tensor<int32_t> rows = follower.chosen().on(Device::cpu);
  return {rows.data(), rows.data() + rows.size()};
}

TEST(Tracks, AreThoseOfWhatMoves) {
  MovingBoard f;
  const std::vector<int32_t> rows = rows_of(f.follower());
  ASSERT_EQ(rows.size(), static_cast<size_t>(MovingBoard::points)) << "the wall stands still";
  for (size_t k = 0; k < rows.size(); ++k) EXPECT_EQ(rows[k], static_cast<int32_t>(k));

  const auto expect_none = [&](const char* why) {
    const TrackFollower follower = f.follower();
    EXPECT_TRUE(follower.chosen().empty()) << why;
    EXPECT_EQ(follower.at(f.scene, 0.5F).count(), 0) << why;
  };
  f.options.tracks.least_move = 1;
  expect_none("none goes as far as an extent");
  f.options.tracks.least_move = 0;
  f.times = {0.5F};
  expect_none("one moment has no motion");
  f.scene.main_motion = still_motion(f.scene.main_motion->centre, f.scene.main_motion->time);
  f.times = {0, 1};
  expect_none("the body stands still");
  f.scene.main_motion.reset();
  expect_none("there is no motion");
  f.scene.main = Surfels();
  expect_none("there is nothing");
}

TEST(Tracks, AreThoseOfOpaqueFiniteSurfels) {
  MovingBoard f;
  f.scene.main.opacity_logit[3] = -3;
  f.scene.main.opacity_logit[4] = NAN;
  f.scene.main.position(5, 1) = INFINITY;
  const std::vector<int32_t> rows = rows_of(f.follower());
  EXPECT_EQ(rows.size(), static_cast<size_t>(MovingBoard::points - 3));
  for (const int32_t row : {3, 4, 5}) EXPECT_EQ(std::count(rows.begin(), rows.end(), row), 0) << row;
}

TEST(Tracks, GoBackOverTheTimesOfTheCapture) {
  MovingBoard f;
  const TrackFollower all = f.follower();
  EXPECT_THAT(all.at(f.scene, 0.75F).age, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(all.at(f.scene, 0).age, ElementsAre(0));
  EXPECT_THAT(all.at(f.scene, 0.6F).age,
              ElementsAre(0, FloatNear(0.4F, 1e-6F), FloatNear(1.4F, 1e-6F), FloatNear(2.4F, 1e-6F)))
      << "two fifths of a step after the third time";
  f.options.tracks.frames = 2;
  EXPECT_THAT(f.follower().at(f.scene, 1).age, ElementsAre(0, 1, 2));
  EXPECT_EQ(f.follower().at(f.scene, 1).oldest, 2);
  // Where no capture is known, the keys of the motion are its times.
  f.times.clear();
  EXPECT_THAT(f.follower().at(f.scene, 1).age, ElementsAre(0, 1, 2));
}

void expect_paths_by_hand(const MovingBoard& f) {
  const TrackFollower follower = f.follower();
  ASSERT_EQ(follower.chosen().size(), MovingBoard::points);
  for (const float time : {0.0F, 0.25F, 0.6F, 1.0F}) {
    const Tracks tracks = follower.at(f.scene, time);
    for (size_t v = 0; v < tracks.age.size(); ++v) {
      const double then = v == 0 ? time : 0.25 * std::ceil(4 * time - 1e-6 - static_cast<double>(v));
      for (int64_t i = 0; i < tracks.count(); ++i) {
        const Vec3<double> found = load3<double>(&tracks.position(static_cast<int64_t>(v), i, 0));
        EXPECT_LT(length(found - f.place_at(i, then)), 1e-6) << "point " << i << " at " << then;
      }
    }
  }
}

TEST(Tracks, AreWhereTheBodyCarriesThem) {
  MovingBoard f;
  expect_paths_by_hand(f);
  f.bend();
  expect_paths_by_hand(f);
}

// A field moves everything: a path is where the renderer poses the surfel.
TEST(Tracks, OfAFieldAreWhereFramesHaveTheSurfels) {
  Fixture f;
  RenderOptions options;
  options.tracks.least_move = 1e-5F;
  f.scene.main.opacity_logit.fill(4);
  const TrackFollower follower(f.scene, f.request, options, {});
  const Tracks tracks = follower.at(f.scene, 0.6F);
  ASSERT_GT(tracks.count(), 100);
  EXPECT_EQ(tracks.age.size(), 13U) << "of 60 even steps";
  Renderer renderer(options);
  for (const auto& [vertex, time] : {std::pair{0, 0.6F}, {12, 0.4F}}) {
    f.request.time = time;
    const Frame& frame = renderer.forward(f.scene, f.request);
    for (int64_t p = 0; p < tracks.count(); ++p) {
      for (int axis = 0; axis < 3; ++axis)
        ASSERT_NEAR(tracks.position(vertex, p, axis), frame.main.position(follower.chosen()[p], axis), 1e-5F);
    }
  }
  f.request.deform_main = false;
  EXPECT_TRUE(TrackFollower(f.scene, f.request, options, {}).chosen().empty()) << "the field takes no part";
}

struct MovingCloud : MovingBoard {
  MovingCloud() {
    Random random(7);
    scene.main = scattered(20000, 0.4F, true, random);
    for (float& v : scene.main.opacity_logit.values()) v = static_cast<float>(random.uniform(0, 4));
    scene.main.body.reset({20000});
  }
};

TEST(Tracks, AreSpreadOverWhatMoves) {
  MovingCloud f;
  f.options.tracks.most = 150;
  const std::vector<int32_t> rows = rows_of(f.follower());
  EXPECT_LE(rows.size(), 150U);
  EXPECT_GE(rows.size(), 100U);
  const auto away = [&](int64_t i, int64_t j) {
    return length(load3<float>(f.scene.main.position.row(i)) - load3<float>(f.scene.main.position.row(j)));
  };
  const auto nearest_of = [&](const std::vector<int32_t>& points) {
    float nearest = HUGE_VALF;
    for (const int32_t a : points) {
      for (const int32_t b : points) nearest = a == b ? nearest : std::min(nearest, away(a, b));
    }
    return nearest;
  };
  const float nearest = nearest_of(rows);
  float farthest = 0;
  for (int64_t i = 0; i < f.scene.main.count(); i += 7) {
    float to_chosen = HUGE_VALF;
    for (const int32_t a : rows) to_chosen = std::min(to_chosen, away(i, a));
    farthest = std::max(farthest, to_chosen);
  }
  EXPECT_GT(nearest, 0.1F);
  EXPECT_LT(farthest, 2 * nearest) << "no mover is far from a point";
  // However many there may be, they do not cover each other: nine tenths of the cloud are 1.3 wide.
  f.options.tracks.most = 2000;
  EXPECT_GT(nearest_of(rows_of(f.follower())), 0.05F);
}

TEST(Tracks, AreTheSamePointsAtAnyTimeAndNumberOfThreads) {
  MovingCloud f;
  set_threads(1);
  const TrackFollower one = f.follower();
  const Tracks early = one.at(f.scene, 0.3F);
  set_threads(3);
  f.request.time = 0.9F;
  f.request.camera.position = {0.5F, 0, -2};
  const TrackFollower three = f.follower();
  const Tracks late = three.at(f.scene, 0.9F), again = three.at(f.scene, 0.3F);
  set_threads(0);
  EXPECT_EQ(rows_of(one), rows_of(three));
  EXPECT_EQ(early.hue, late.hue);
  ASSERT_EQ(early.position.shape(), again.position.shape());
  EXPECT_TRUE(std::equal(early.position.values().begin(), early.position.values().end(),
                         again.position.values().begin()));
}

TEST(Tracks, HaveOptionsInTheirRanges) {
  const auto refuses = [](auto change) {
    RenderOptions options;
    options.validate();
    change(options.tracks);
    EXPECT_THROW(options.validate(), InputError);
  };
  refuses([](TracksOptions& o) { o.frames = 0; });
  refuses([](TracksOptions& o) { o.frames = 1001; });
  refuses([](TracksOptions& o) { o.most = 0; });
  refuses([](TracksOptions& o) { o.most = 2001; });
  refuses([](TracksOptions& o) { o.least_move = -0.1F; });
  refuses([](TracksOptions& o) { o.least_move = NAN; });
}

}  // namespace
}  // namespace traceflow::viz

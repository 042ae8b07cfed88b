#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "train/trainer.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

// What was decided when the second time was to be followed, and whether any body has moved since.
struct Followed {
  std::optional<events::FollowingDecided> decided;
  bool moves = false;
};

constexpr int iterations = 400;
const int fourth_time = iterations / 8 + 4 * TrackOptions().map_each;

// Trains up to an iteration. Resumes from its own checkpoint as soon as it is decided where `resumes`.
Followed followed(const Capture& capture, float still, int until, bool resumes = false) {
  TrainOptions options = preset("cpu");
  options.iterations = iterations;
  options.specular = Specular::none;
  options.initial.max_points = options.density.max_surfels = 4000;
  options.deform.track.still = still;
  const fs::path folder = fs::path(::testing::TempDir()) / ("still_" + std::to_string(::getpid()));
  Followed result;
  const auto listen = [&](Trainer& trainer) {
    trainer.stream().listen([&](const events::Event& event) {
      if (const auto* e = std::get_if<events::FollowingDecided>(&event)) result.decided = *e;
    });
  };
  auto trainer = std::make_unique<Trainer>(options, capture, folder);
  listen(*trainer);
  while (trainer->iteration() < until) {
    trainer->step();
    if (!resumes || !result.decided) continue;
    resumes = false;
    trainer->save();
    trainer = std::make_unique<Trainer>(options, capture, folder);
    listen(*trainer);
    trainer->resume();
  }
  const Motion& motion = *trainer->scene().main_motion;
  const auto moves = [](float entry) { return entry != 0; };
  result.moves = std::ranges::any_of(motion.shift.values(), moves);
  for (int64_t i = 0; i < motion.rotation.size(); i += 4)
    result.moves = result.moves || std::ranges::any_of(motion.rotation.values().subspan(i + 1, 3), moves);
  return result;
}

TEST(StillBodies, AreNotFollowed) {
  const Tumbling at;
  const Followed moving = followed(at.capture, TrackOptions().still, fourth_time);
  ASSERT_TRUE(moving.decided);
  EXPECT_TRUE(moving.decided->follows);
  EXPECT_TRUE(moving.moves);

  // The first picture, at all times.
  Capture still = at.capture;
  for (View& view : still.train) {
    const float time = view.time;
    view = at.capture.train.front();
    view.time = time;
  }
  // Nor do their poses train, also where the film of a body that moves has been followed to its end.
  const int end = iterations / 8 + static_cast<int>(still.train.size()) * TrackOptions().map_each + 5;
  const Followed standing = followed(still, TrackOptions().still, end);
  ASSERT_TRUE(standing.decided);
  EXPECT_FALSE(standing.decided->follows);
  EXPECT_LT(standing.decided->silhouettes, moving.decided->silhouettes);
  EXPECT_FALSE(standing.moves);
  EXPECT_TRUE(followed(still, 0, fourth_time).decided->follows);

  const Followed resumed = followed(still, TrackOptions().still, end, true);
  EXPECT_FALSE(resumed.decided->follows);
  EXPECT_FALSE(resumed.moves);
}

// With normal priors everything trains as soon as it is known that bodies stand, tints too; without them not
// before the end of the film.
TEST(StillBodies, ReflectAtOnceWhereThereAreNormalPriors) {
  const Tumbling at;
  for (const bool priors : {true, false}) {
    Capture capture = at.capture;
    capture.has_normal_priors = priors;
    TrainOptions options = preset("cpu");
    options.iterations = iterations;
    options.initial.max_points = options.density.max_surfels = 2000;
    options.deform.track.still = 1000;
    Trainer trainer(options, std::move(capture),
                    fs::path(::testing::TempDir()) / ("reflects_" + std::to_string(::getpid())));
    bool decided = false;
    trainer.stream().listen([&](const events::Event& event) {
      decided |= std::holds_alternative<events::FollowingDecided>(event);
    });
    while (!decided) trainer.step();
    const std::vector<float> before(trainer.scene().main.tint_logit.values().begin(),
                                    trainer.scene().main.tint_logit.values().end());
    for (int i = 0; i < 5; ++i) trainer.step();
    EXPECT_EQ(!std::ranges::equal(before, trainer.scene().main.tint_logit.values()), priors);
  }
}

// Views of the first time alone are drawn before it is decided, and then those of all times, of which the
// scene knows nothing yet.
TEST(StillBodies, ViewsOfAllTimesAreNoCollapse) {
  const Tumbling at;
  TrainOptions options = preset("cpu");
  options.iterations = 2400;
  options.specular = Specular::none;
  options.initial.max_points = options.density.max_surfels = 2000;
  options.deform.track.still = 1000;
  options.collapse_decibels = 1;
  Trainer trainer(options, at.capture,
                  fs::path(::testing::TempDir()) / ("all_times_" + std::to_string(::getpid())));
  constexpr int long_after = 60;
  bool follows = true;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* e = std::get_if<events::FollowingDecided>(&event)) follows = e->follows;
    const auto* step = std::get_if<events::Step>(&event);
    if (step && step->iteration > options.deform.track.warm_up + long_after) trainer.stop_soon();
  });
  EXPECT_EQ(trainer.run(std::atomic<bool>(false)).ending, events::Ending::interrupted);
  EXPECT_FALSE(follows);
}

}  // namespace
}  // namespace traceflow

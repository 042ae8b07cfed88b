#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "train/trainer.h"
#include "train/tumbling.h"

namespace traceflow {
namespace {

// What was decided when the second time was to be followed, and whether any body has moved by the fourth.
struct Followed {
  std::optional<events::FollowingDecided> decided;
  bool moves = false;
};

// Resumes from its own checkpoint as soon as it is decided where `resumes`.
Followed followed_a_little(const Capture& capture, float still, bool resumes = false) {
  TrainOptions options = preset("cpu");
  options.iterations = 400;
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
  while (trainer->iteration() < options.iterations / 8 + 4 * options.deform.track.map_each) {
    trainer->step();
    if (!resumes || !result.decided) continue;
    resumes = false;
    trainer->save();
    trainer = std::make_unique<Trainer>(options, capture, folder);
    listen(*trainer);
    trainer->resume();
  }
  result.moves = std::ranges::any_of(trainer->scene().main_motion->shift.values(),
                                     [](float shift) { return shift != 0; });
  return result;
}

TEST(StillBodies, AreNotFollowed) {
  const Tumbling at;
  const Followed moving = followed_a_little(at.capture, TrackOptions().still);
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
  const Followed standing = followed_a_little(still, TrackOptions().still);
  ASSERT_TRUE(standing.decided);
  EXPECT_FALSE(standing.decided->follows);
  EXPECT_LT(standing.decided->silhouettes, moving.decided->silhouettes);
  EXPECT_FALSE(standing.moves);
  EXPECT_TRUE(followed_a_little(still, 0).decided->follows);

  const Followed resumed = followed_a_little(still, TrackOptions().still, true);
  EXPECT_FALSE(resumed.decided->follows);
  EXPECT_FALSE(resumed.moves);
}

}  // namespace
}  // namespace traceflow

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
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

Followed followed_a_little(const Capture& capture, float still) {
  TrainOptions options = preset("cpu");
  options.iterations = 400;
  options.specular = Specular::none;
  options.initial.max_points = options.density.max_surfels = 4000;
  options.deform.track.still = still;
  Trainer trainer(options, capture, fs::path(::testing::TempDir()) / ("still_" + std::to_string(::getpid())));
  Followed result;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* e = std::get_if<events::FollowingDecided>(&event)) result.decided = *e;
  });
  while (trainer.iteration() < options.iterations / 8 + 4 * options.deform.track.map_each) trainer.step();
  result.moves = std::ranges::any_of(trainer.scene().main_motion->shift.values(),
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
}

}  // namespace
}  // namespace traceflow

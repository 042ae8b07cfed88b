#include "cli/runs/render_shots.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "capture/fake_capture.h"
#include "support/refusal.h"

// Which shots the flags choose, of captures of every shape.
namespace traceflow::cli {
namespace {

ShotArguments freezing(const std::string& view, const FakeCapture& fake) {
  ShotArguments arguments;
  arguments.freeze_camera = view;
  arguments.capture = fake.path().string();
  return arguments;
}

// The same view with twice as many pixels a side.
void enlarge(const std::string& id, FakeCapture& fake) {
  fake.cameras[id]["image_size"] = {2 * fake.width, 2 * fake.height};
  fake.cameras[id]["principal_point"] = {fake.width, fake.height};
  fake.write_image("rgb/1x/" + id + ".png", Tensor<uint8_t>({2 * fake.height, 2 * fake.width, 3}));
}

std::vector<std::string> photographed(const ChosenShots& chosen) {
  std::vector<std::string> found(chosen.photographs.size());
  std::transform(chosen.photographs.begin(), chosen.photographs.end(), found.begin(),
                 [](const View& view) { return view.id; });
  return found;
}

TEST(FreezeCamera, TakesATrainingViewWhereNothingTests) {
  const InterpCapture fake(1);
  fake.save();
  const LoadedScene scene{};
  ShotArguments arguments = freezing("000000", fake);
  EXPECT_EQ(choose_shots(arguments, scene).shots.size(), 1U);
  arguments.freeze_camera = "0";
  EXPECT_THAT(refusal_of([&] { choose_shots(arguments, scene); }),
              testing::HasSubstr("split test: found no views, expected at least one; try --split train"));
  arguments.split = "train";
  EXPECT_EQ(choose_shots(arguments, scene).shots.size(), 1U);
  arguments.freeze_camera = "1";
  EXPECT_THAT(refusal_of([&] { choose_shots(arguments, scene); }),
              testing::HasSubstr("as 000000, or its place in the train views, 0 to 0"));
}

TEST(FreezeCamera, TellsTheTimesOfTheCapture) {
  NerfDsCapture fake(3);
  fake.save();
  ShotArguments arguments = freezing("000001_left", fake);
  arguments.frames = 7;
  EXPECT_THAT(choose_shots(arguments, LoadedScene{}).times, testing::ElementsAre(0, 0.5F, 1))
      << "each once, though two cameras have it";
}

// At time 0 the right camera stands nearer to where the left one is at time 1.
TEST(FreezeCamera, StandsBesideTheNearestPhotographOfItsSize) {
  NerfDsCapture fake(3);
  fake.save();
  const LoadedScene scene{};
  ShotArguments arguments = freezing("000001_left", fake);
  arguments.compare = true;
  EXPECT_THAT(photographed(choose_shots(arguments, scene)),
              testing::ElementsAre("000000_right", "000001_left", "000002_left"));
  for (const char* id : {"000000_right", "000001_right", "000002_right"}) enlarge(id, fake);
  fake.save();
  EXPECT_THAT(photographed(choose_shots(arguments, scene)),
              testing::ElementsAre("000000_left", "000001_left", "000002_left"));
}

TEST(FreezeCamera, IsNotComparedWhereATimeHasNoPhotographOfItsSize) {
  NerfDsCapture fake(3);
  for (const char* id : {"000002_left", "000002_right"}) enlarge(id, fake);
  fake.save();
  const LoadedScene scene{};
  ShotArguments arguments = freezing("000001_left", fake);
  EXPECT_EQ(choose_shots(arguments, scene).shots.size(), 3U);
  arguments.compare = true;
  EXPECT_EQ(refusal_of([&] { choose_shots(arguments, scene); }),
            "option: compare: found 000002_left of 24×16 at time 1.000, expected a photograph of 12×8, the "
            "frozen camera's size: leave --compare out, or freeze another");
}

}  // namespace
}  // namespace traceflow::cli

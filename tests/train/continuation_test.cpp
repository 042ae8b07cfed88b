#include "train/continuation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "files/options_json.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Capture three_views() {
  Capture capture;
  capture.folder = "here";
  capture.normalisation = {{0.1, -2, 30}, 0.25};
  for (int i = 0; i < 3; ++i) {
    View& view = capture.train.emplace_back();
    view.id = "view" + std::to_string(i);
    view.time = static_cast<float>(i) / 2;
    view.camera.position = {static_cast<float>(i), 0.5F, -1};
    view.camera.width = 40;
  }
  return capture;
}

Safetensors checkpoint_of(const Capture& capture) {
  Safetensors file;
  file.metadata["capture_folder"] = "there";
  put_views(checksum_of_views(capture), file);
  return file;
}

std::string refusal_of_views(const Safetensors& file, const std::function<void(Capture&)>& change) {
  Capture capture = three_views();
  change(capture);
  return refusal_of([&] { check_views(file, three_views().normalisation, capture); });
}

TEST(Continuation, AnotherCaptureOfAsManyViewsIsRefused) {
  const Safetensors file = checkpoint_of(three_views());
  const auto says_so = AllOf(HasSubstr("--data: found here, whose views have other names, times or poses"),
                             HasSubstr("then in there"));
  EXPECT_EQ(refusal_of_views(file, [](Capture&) {}), "accepted");
  for (const std::function<void(Capture&)>& change : std::vector<std::function<void(Capture&)>>{
           [](Capture& c) { c.train[2].id = "view3"; }, [](Capture& c) { c.train[1].time = 0.501F; },
           [](Capture& c) { c.train[1].camera.position.z = -1.001F; },
           [](Capture& c) { c.train[0].camera.camera_from_world[1].z = 0.001F; },
           [](Capture& c) { std::swap(c.train[0], c.train[1]); }, [](Capture& c) { c.train.pop_back(); },
           [](Capture& c) { c.normalisation.centre.y -= 0.01; },
           [](Capture& c) { c.normalisation.scale *= 1.01; }}) {
    EXPECT_THAT(refusal_of_views(file, change), says_so);
  }
}

TEST(Continuation, TheSameCaptureElsewhereOrSmallerIsTaken) {
  const Safetensors file = checkpoint_of(three_views());
  EXPECT_EQ(refusal_of_views(file,
                             [](Capture& c) {
                               c.folder = "elsewhere";
                               c.train[0].camera.width = 20;
                               c.train[1].camera.position.x += 1e-7F;
                               c.normalisation.centre.z += 1e-9;
                             }),
            "accepted");
}

TEST(Continuation, ACheckpointThatSaysNothingOfViewsIsHeldAgainstTheNormalisation) {
  Safetensors file = checkpoint_of(three_views());
  file.metadata.erase("views_crc32");
  EXPECT_EQ(refusal_of_views(file, [](Capture& c) { c.train[1].time = 0.6F; }), "accepted");
  EXPECT_THAT(refusal_of_views(file, [](Capture& c) { c.normalisation.scale *= 1.01; }), HasSubstr("--data"));
}

TEST(Continuation, CapsAreKeptUntilWhatTheyComeFromIsChanged) {
  TrainOptions options = preset("demo");
  Safetensors file;
  file.metadata["options"] = options_to_json(options);
  EXPECT_FALSE(caps_to_keep(file, options));
  put_caps({2'000'000'000, 7, true}, file);
  const std::optional<SurfelCaps> caps = caps_to_keep(file, options);
  ASSERT_TRUE(caps);
  EXPECT_EQ(caps->main, 2'000'000'000);
  EXPECT_EQ(caps->environment, 7);
  for (const std::function<void(TrainOptions&)>& change : std::vector<std::function<void(TrainOptions&)>>{
           [](TrainOptions& o) { o.memory_budget = 4000; },
           [](TrainOptions& o) { o.density.max_surfels += 1; },
           [](TrainOptions& o) { o.environment_density.max_surfels += 1; }}) {
    TrainOptions other = options;
    change(other);
    EXPECT_FALSE(caps_to_keep(file, other));
  }
}

TEST(Continuation, ACaptureIsThatOfTheRunOrNot) {
  const Capture capture = three_views();
  const std::string views = views_in(checkpoint_of(capture));
  EXPECT_TRUE(are_views_of(views, capture.normalisation, capture));
  Capture other = three_views();
  other.train[1].time = 0.4F;
  EXPECT_FALSE(are_views_of(views, capture.normalisation, other));
  EXPECT_TRUE(are_views_of(views_in(Safetensors()), capture.normalisation, other))
      << "nothing is known of them";
}

// Bounds that came later do not change how a run that has none of them goes on.
TEST(Continuation, OlderCheckpointsKeepTheBoundsThatTheyHad) {
  Safetensors file;
  file.metadata["options"] = R"({"iterations": 100})";
  const TrainOptions options = options_in(file);
  EXPECT_EQ(options.iterations, 100);
  for (const DensityOptions& density : {options.density, options.environment_density}) {
    EXPECT_EQ(density.prune_above_from, 0);
    EXPECT_EQ(density.prune_above_cloud, 1000);
  }
  file.metadata["options"] = R"({"nonsense": 100})";
  EXPECT_THAT(refusal_of([&] { options_in(file, "a/checkpoint"); }), HasSubstr("a/checkpoint: options"));
}

TEST(Continuation, AnotherVersionIsTold) {
  Safetensors file;
  EXPECT_EQ(other_version(file), "");
  put_version(file);
  EXPECT_EQ(other_version(file), "");
  file.metadata["program_version"] = "0.0.9";
  EXPECT_THAT(other_version(file), AllOf(HasSubstr("version 0.0.9"), HasSubstr("other bytes")));
}

}  // namespace
}  // namespace traceflow

#include "serve/live_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "record/event_log.h"
#include "serve/clients/fake_page.h"
#include "train/small_run.h"

namespace traceflow::serve {
namespace {

using serve::testing::FakePage;
using serve::testing::view_request;

// A small training that is watched.
struct WatchedRun {
  WatchedRun(int iterations, const std::string& name)
      : trainer(make_trainer(small_run(iterations), name)),
        view({0.5}, make_scene_info("training", name, &trainer.capture(), trainer.scene().normalisation),
             {[this] {
                return SceneView{trainer.scene(), picture_render(trainer.options(), trainer.iteration()),
                                 picture_request(trainer.options(), trainer.iteration()),
                                 trainer.iteration()};
              },
              [this] {
                if (cannot_save) throw InputError("run", "", "a full disk", "handler");
                trainer.save();
              },
              [this](const events::Event& event) { trainer.stream().emit(event); },
              [this] { trainer.stop_soon(); }, &stop}) {
    trainer.stream().listen([this](const events::Event& event) { view(event); });
  }

  Trainer trainer;
  bool cannot_save = false;
  std::atomic<bool> stop{false};
  LiveView view;
};

// Acknowledges frames and asks for the next view until the run is over.
class Wanderer {
 public:
  explicit Wanderer(FakePage& page)
      : thread_([this, &page] {
          for (int64_t id = 1; !over_; ++id) {
            auto message = view_request(id, id % 3 != 0);
            message["camera"]["position"][0] = 0.1 * static_cast<double>(id % 10);
            page.say(message);
            page.acknowledge_frames();
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
          }
        }) {}
  ~Wanderer() {
    over_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> over_{false};
  std::thread thread_;
};

TEST(LiveView, TrainingGoesByTheSameBytesWhetherSomebodyLooksOrNot) {
  Trainer alone = make_trainer(small_run(30), "view_alone");
  alone.run(never);

  WatchedRun watched(30, "view_watched");
  FakePage page(watched.view.handler(), 1);
  {
    const Wanderer wanderer(page);
    watched.trainer.run(watched.stop);
  }
  EXPECT_GT(page.of("frame").size(), 0U);
  EXPECT_EQ(scene_bytes(watched.trainer.scene()), scene_bytes(alone.scene()));
}

TEST(LiveView, TellsWhatHappens) {
  WatchedRun watched(12, "view_told");
  const FakePage page(watched.view.handler(), 1);
  watched.trainer.run(watched.stop);
  ASSERT_EQ(page.of("hello").size(), 1U);
  EXPECT_EQ(page.of("hello")[0].json["source"], "training");
  EXPECT_EQ(page.of("hello")[0].json["cameras"]["train"].size(), watched.trainer.capture().train.size());
  std::vector<std::string> kinds;
  for (const auto& message : page.of("events")) {
    for (const auto& event : message.json["events"]) kinds.push_back(event["event"]);
  }
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds.front(), "started");
  EXPECT_EQ(kinds.back(), "finished");
  EXPECT_EQ(std::count(kinds.begin(), kinds.end(), "phase_entered"), 3);
  EXPECT_TRUE(page.of("state").back().json["over"].get<bool>());
  EXPECT_EQ(page.of("state").back().json["iteration"], 12);
}

TEST(LiveView, APauseHoldsTheIterationAndGoesOnShowing) {
  WatchedRun watched(20, "view_paused");
  FakePage page(watched.view.handler(), 1);
  std::atomic<int64_t> reached{0}, saved{-1};
  watched.trainer.stream().listen([&](const events::Event& event) {
    if (const auto* step = std::get_if<events::Step>(&event)) reached = step->iteration;
    if (const auto* save = std::get_if<events::Saved>(&event)) saved = save->iteration;
  });
  page.say({{"type", "command"}, {"do", "pause"}});
  std::thread training([&] { watched.trainer.run(watched.stop); });
  const auto wait_for = [&](bool paused) {
    for (size_t states = 1; page.wait_for("state", states); ++states) {
      if (page.of("state")[states - 1].json["paused"] == paused && states > 1) return true;
    }
    return false;
  };
  ASSERT_TRUE(wait_for(true));
  const auto held_at = page.of("state").back().json["iteration"].get<int64_t>();
  EXPECT_EQ(held_at, 1);
  page.say(view_request(1));
  ASSERT_TRUE(page.wait_for("frame", 1));
  EXPECT_EQ(page.of("frame")[0].json["iteration"], held_at);
  page.say({{"type", "command"}, {"do", "save"}});
  while (saved < 0) std::this_thread::yield();
  EXPECT_EQ(saved, held_at);
  EXPECT_LE(reached, held_at);
  page.say({{"type", "command"}, {"do", "resume"}});
  training.join();
  EXPECT_EQ(reached, 20);
  EXPECT_FALSE(page.of("state").back().json["paused"].get<bool>());
}

TEST(LiveView, StopsAPausedTraining) {
  WatchedRun watched(20, "view_stopped");
  FakePage page(watched.view.handler(), 1);
  page.say({{"type", "command"}, {"do", "pause"}});
  page.say({{"type", "command"}, {"do", "stop"}});
  const events::Finished end = watched.trainer.run(watched.stop);
  EXPECT_EQ(end.ending, events::Ending::interrupted);
  EXPECT_LE(end.iteration, 1);
}

TEST(LiveView, StaysUntilTheLastPageHasLeft) {
  WatchedRun watched(3, "view_stays");
  FakePage page(watched.view.handler(), 1);
  watched.trainer.run(watched.stop);
  std::thread leaving([&] {
    page.say(view_request(1));
    EXPECT_TRUE(page.wait_for("frame", 1));
    page.leave();
  });
  watched.view.stay();
  leaving.join();
  EXPECT_FALSE(watched.view.is_wanted());
}

// Where a folder cannot be written to, a page's wish to save is told to have failed, and the training goes
// on.
TEST(LiveView, ASaveThatFailsEndsNothing) {
  WatchedRun watched(10, "view_unsaved");
  watched.cannot_save = true;
  FakePage page(watched.view.handler(), 1);
  page.say({{"type", "command"}, {"do", "save"}});
  EXPECT_EQ(watched.trainer.run(watched.stop).ending, events::Ending::completed);
  EXPECT_THAT(page.of("warning").at(0).json["text"].get<std::string>(), ::testing::HasSubstr("full"));
}

TEST(LiveView, StaysForThePageThatStoppedItAndForNobodyElse) {
  WatchedRun watched(20, "view_stays_stopped");
  FakePage page(watched.view.handler(), 1);
  page.say({{"type", "command"}, {"do", "stop"}});
  watched.trainer.run(watched.stop);
  EXPECT_TRUE(watched.view.is_wanted());

  WatchedRun interrupted(20, "view_interrupted");
  FakePage other(interrupted.view.handler(), 1);
  interrupted.stop = true;
  interrupted.trainer.run(interrupted.stop);
  EXPECT_FALSE(interrupted.view.is_wanted());
}

TEST(LiveView, AShareIsAboveNoneAndUnderAll) {
  EXPECT_NO_THROW(ViewOptions{0.9}.validate());
  for (const double share : {0.0, 1.0, -1.0, std::nan("")})
    EXPECT_THROW(ViewOptions{share}.validate(), InputError);
}

}  // namespace
}  // namespace traceflow::serve

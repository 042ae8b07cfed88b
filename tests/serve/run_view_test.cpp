#include "serve/run_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <new>

#include "record/event_log.h"
#include "serve/clients/fake_page.h"
#include "support/temp_folder.h"
#include "train/small_run.h"

namespace traceflow::serve {
namespace {

using serve::testing::FakePage;
using serve::testing::view_request;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A run that is trained here and followed as by another process; checked when a test says so.
class FollowedRun {
 public:
  explicit FollowedRun(const std::string& name)
      : trainer_(small_run(40), load_capture(capture_folder(), small_run(40).capture), run_.folder) {
    train_to(2);
    view_.emplace(make_scene_info("run", name, &trainer_.capture(), trainer_.scene().normalisation), reread(),
                  Device::cpu);
    page_.emplace(view_->handler(), 1);
  }
  void follow() {
    view_->follow(RunWatch(run_),
                  [this] {
                    ++reads_;
                    return reread();
                  },
                  {});
  }

  // Every checkpoint differs from the one before in what a RunWatch sees.
  void train_to(int iteration) {
    while (trainer_.iteration() < iteration) trainer_.step();
    trainer_.save();
    fs::last_write_time(run_.checkpoint(),
                        fs::file_time_type(std::chrono::hours(24)) + std::chrono::seconds(iteration));
  }
  void damage() const { fs::resize_file(run_.checkpoint(), 100); }
  void log(const std::string& text) const { std::ofstream(run_.log(), std::ios::app) << text; }
  void check_run() { view_->turn({}); }

  // What the page knows.
  int64_t iteration() const { return page_->of("state").back().json["iteration"]; }
  std::string warning() const {
    const auto all = page_->of("warning");
    return all.empty() ? "" : all.back().json["text"];
  }
  // The iteration of the picture of a new ViewRequest.
  int64_t pictured() {
    page_->acknowledge_frames();
    page_->say(view_request(++view_requests_));
    const size_t before = page_->of("frame").size();
    view_->turn({});
    const auto frames = page_->of("frame");
    return frames.size() == before ? -1 : frames.back().json["iteration"].get<int64_t>();
  }
  // The iterations of the events of the last message of events, after "new" where they replace what was told.
  std::vector<std::string> last_events() const {
    const auto message = page_->of("events").back().json;
    std::vector<std::string> list;
    if (message["reset"]) list.emplace_back("new");
    for (const auto& e : message["events"])
      list.push_back(e["event"].get<std::string>() + " " + std::to_string(e["iteration"].get<int64_t>()));
    return list;
  }
  size_t messages_of_events() const { return page_->of("events").size(); }
  const RunFolder& run() const { return run_; }
  int reads() const { return reads_; }
  std::function<void()> before_reading = [] {};

 private:
  RunView::Shown reread() const {
    before_reading();
    RunView::Shown shown;
    const Safetensors file = read_checkpoint(run_, shown.note);
    shown.iteration = std::stoll(file.metadata.at("iteration"));
    shown.iterations = trainer_.options().iterations;
    shown.subject.scene = get_scene(file);
    shown.subject.render = trainer_.options().render;
    shown.subject.request = picture_request(trainer_.options(), static_cast<int>(shown.iteration));
    return shown;
  }

  TempFolder folder_;
  RunFolder run_{folder_ / "run"};
  Trainer trainer_;
  std::optional<RunView> view_;
  std::optional<FakePage> page_;
  int64_t view_requests_ = 0;
  int reads_ = 0;
};

TEST(RunView, ShowsANewCheckpoint) {
  FollowedRun r("new_checkpoint");
  r.follow();
  r.check_run();
  EXPECT_EQ(r.reads(), 0);
  EXPECT_EQ(r.iteration(), 2);
  EXPECT_EQ(r.pictured(), 2);
  r.train_to(4);
  r.check_run();
  EXPECT_EQ(r.iteration(), 4);
  EXPECT_EQ(r.pictured(), 4);
  r.check_run();
  EXPECT_EQ(r.reads(), 1);
  EXPECT_EQ(r.warning(), "");
}

TEST(RunView, ADamagedCheckpointIsAWarningUntilAGoodOneComes) {
  FollowedRun r("damaged");
  r.follow();
  r.damage();
  r.check_run();
  EXPECT_THAT(r.warning(), HasSubstr("cannot be read"));
  EXPECT_EQ(r.iteration(), 2);
  EXPECT_EQ(r.pictured(), 2);
  r.train_to(4);
  r.check_run();
  EXPECT_EQ(r.warning(), "");
  EXPECT_EQ(r.iteration(), 4);
  EXPECT_EQ(r.pictured(), 4);
}

TEST(RunView, WhatCouldNotBeReadIsReadAgain) {
  FollowedRun r("read_again");
  r.follow();
  r.train_to(4);
  const std::function<void()> failures[] = {
      [] { throw std::bad_alloc(); }, [] { throw InputError("checkpoint", "", "nothing", "something"); },
      [] { throw fs::filesystem_error("no", std::make_error_code(std::errc::io_error)); }};
  for (const auto& failure : failures) {
    r.before_reading = failure;
    EXPECT_NO_THROW(r.check_run());
    EXPECT_NE(r.warning(), "");
    EXPECT_EQ(r.iteration(), 2);
    EXPECT_EQ(r.pictured(), 2);
  }
  r.before_reading = [] {};
  r.check_run();
  EXPECT_EQ(r.warning(), "");
  EXPECT_EQ(r.iteration(), 4);
}

TEST(RunView, TellsWhenItIsTheCheckpointBefore) {
  FollowedRun r("before");
  r.follow();
  r.train_to(4);
  r.train_to(6);
  r.damage();
  r.check_run();
  EXPECT_EQ(r.iteration(), 4);
  EXPECT_THAT(r.warning(), HasSubstr("using the checkpoint before it"));
  r.check_run();
  EXPECT_EQ(r.reads(), 1) << "there is nothing else to read";
  EXPECT_THAT(r.warning(), HasSubstr("using the checkpoint before it"));
  r.train_to(8);
  r.check_run();
  EXPECT_EQ(r.iteration(), 8);
  EXPECT_EQ(r.warning(), "");
}

TEST(RunView, ARunThatIsGoneIsAWarningUntilItIsBack) {
  FollowedRun r("gone");
  r.follow();
  const fs::path away = r.run().folder.parent_path() / "away";
  fs::rename(r.run().folder, away);
  r.check_run();
  EXPECT_THAT(r.warning(), HasSubstr("The run is gone from " + r.run().folder.string()));
  EXPECT_EQ(r.pictured(), 2);
  fs::rename(away, r.run().folder);
  r.check_run();
  EXPECT_EQ(r.warning(), "");
  EXPECT_EQ(r.reads(), 0);
}

TEST(RunView, TellsTheLogAsItGrows) {
  const auto step = [](int64_t iteration) {
    events::Step event;
    event.iteration = iteration;
    return to_json_line(event) + "\n";
  };
  const auto start = [](int64_t iteration) {
    events::Started event;
    event.iteration = iteration;
    return to_json_line(event) + "\n";
  };
  FollowedRun r("log");
  r.log(start(0) + step(1));
  r.follow();
  EXPECT_THAT(r.last_events(), ElementsAre("new", "started 0", "step 1"));
  r.log(step(2));
  r.check_run();
  EXPECT_THAT(r.last_events(), ElementsAre("step 2"));
  const size_t told = r.messages_of_events();
  r.check_run();
  EXPECT_EQ(r.messages_of_events(), told) << "nothing new";
  r.log(start(1) + step(2));
  r.check_run();
  EXPECT_THAT(r.last_events(), ElementsAre("new", "started 0", "step 1", "started 1", "step 2"));
}

}  // namespace
}  // namespace traceflow::serve

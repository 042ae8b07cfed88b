#include "serve/clients/clients.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "serve/clients/fake_page.h"

namespace traceflow::serve {
namespace {

using nlohmann::json;
using serve::testing::FakePage;
using serve::testing::Received;
using serve::testing::view_request;

// What a renderer would do with a frame's job.
void make_frame(Clients& clients, const Job& job) {
  const FrameJob& frame = std::get<FrameJob>(job.what);
  const double divisor = frame.coarseness.divisor;
  clients.show_frame(job,
                     {{"type", "frame"}, {"view", frame.view_request.id}, {"final", frame.coarseness.final}},
                     "picture", 96 * 64 / (divisor * divisor), 1e-4);
}

// Serves a page until nothing is left to do; returns the frames' coarseness.
std::vector<Coarseness> serve_all(Clients& clients, FakePage& page) {
  std::vector<Coarseness> made;
  while (const auto job = clients.next()) {
    made.push_back(std::get<FrameJob>(job->what).coarseness);
    make_frame(clients, *job);
    page.acknowledge_frames();
  }
  return made;
}

std::vector<std::string> types(const FakePage& page) {
  std::vector<std::string> list;
  for (const Received& r : page.all()) list.push_back(r.json["type"]);
  return list;
}

TEST(Clients, TellsANewcomerWhatThereIs) {
  Clients clients;
  clients.set_hello(R"({"type":"hello"})");
  clients.add_log_lines({R"({"event":"saved","iteration":4})"});
  clients.set_warning("disk", "It is full.");
  clients.set_state({false, false, 4, 10, 100, 20});
  const FakePage page(clients, 1);
  EXPECT_THAT(types(page), ::testing::ElementsAre("hello", "events", "warning", "state"));
  EXPECT_EQ(page.of("events")[0].json,
            json::parse(R"({"type":"events","events":[{"event":"saved","iteration":4}],
      "reset":true})"));
  EXPECT_EQ(page.of("warning")[0].json["text"], "It is full.");
  EXPECT_EQ(page.of("state")[0].json,
            json::parse(R"({"type":"state","paused":false,"over":false,"iteration":4,
      "iterations":10,"surfels":{"main":100,"environment":20},"viewers":1})"));
}

TEST(Clients, TellsEverybodyWhatChanges) {
  Clients clients;
  const FakePage page(clients, 1);
  FakePage other(clients, 2);
  clients.set_hello("{\"type\":\"hello\"}");
  clients.set_hello("{\"type\":\"hello\"}");
  EXPECT_EQ(page.of("hello").size(), 1U) << "said once, because nothing changed";
  clients.add_log_lines({R"({"event":"step","iteration":1})", R"({"event":"step","iteration":2})"});
  EXPECT_EQ(page.of("events").back().json["events"].size(), 2U);
  EXPECT_EQ(other.of("events").back().json["reset"], false);
  other.leave();
  EXPECT_EQ(page.of("state").back().json["viewers"], 1);
  EXPECT_EQ(clients.viewers(), 1);
}

TEST(Clients, WarningsEndOneByOne) {
  Clients clients;
  const FakePage page(clients, 1);
  clients.set_warning("memory", "");
  EXPECT_TRUE(page.of("warning").empty());
  clients.set_warning("memory", "No memory.");
  clients.set_warning("run", "No run.");
  clients.set_warning("run", "No run.");
  EXPECT_EQ(page.of("warning").back().json["text"], "No memory. No run.");
  clients.set_warning("memory", "");
  EXPECT_EQ(page.of("warning").back().json["text"], "No run.");
  clients.set_warning("run", "");
  EXPECT_EQ(page.of("warning").back().json["text"], "");
  EXPECT_EQ(page.of("warning").size(), 4U);
}

TEST(Clients, HasNothingToDoWhileNobodyLooks) {
  Clients clients;
  EXPECT_FALSE(clients.next());
  FakePage page(clients, 1);
  EXPECT_FALSE(clients.next());
  EXPECT_FALSE(clients.wait({}));
  page.say(view_request(1));
  EXPECT_TRUE(clients.wait({}));
  page.say({{"type", "sleep"}});
  EXPECT_FALSE(clients.next());
  page.say(view_request(2));
  EXPECT_TRUE(clients.next());
  page.leave();
  EXPECT_FALSE(clients.next());
}

TEST(Clients, ShowsARestingViewFinerAndFinerUntilItIsFinal) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  const std::vector<Coarseness> made = serve_all(clients, page);
  ASSERT_GE(made.size(), 2U);
  EXPECT_GT(made.front().divisor, 1);
  EXPECT_EQ(made.back().divisor, 1);
  for (const Coarseness& c : made) EXPECT_EQ(c.final, &c == &made.back());
  EXPECT_EQ(page.of("frame").size(), made.size());
}

TEST(Clients, ShowsAMovingViewOnce) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1, true));
  EXPECT_EQ(serve_all(clients, page).size(), 1U);
}

TEST(Clients, TheNewestViewRequestCounts) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1, true));
  page.say(view_request(2, true));
  const auto job = clients.next();
  ASSERT_TRUE(job);
  EXPECT_EQ(std::get<FrameJob>(job->what).view_request.id, 2);
  // Another one comes while this one is rendered: the frame goes out, and the new one is still wanted.
  page.say(view_request(3, true));
  make_frame(clients, *job);
  const auto next = clients.next();
  ASSERT_TRUE(next);
  EXPECT_EQ(std::get<FrameJob>(next->what).view_request.id, 3);
}

TEST(Clients, RunsNoMoreThanTwoFramesAhead) {
  Clients clients;
  FakePage page(clients, 1);
  for (int64_t id = 1; id <= 2; ++id) {
    page.say(view_request(id, true));
    make_frame(clients, *clients.next());
  }
  page.say(view_request(3, true));
  EXPECT_FALSE(clients.next());
  page.say({{"type", "frame_shown"}, {"frame", 1}});
  EXPECT_TRUE(clients.next());
  EXPECT_EQ(page.of("frame")[0].json["frame"], 1);
  EXPECT_EQ(page.of("frame")[1].json["frame"], 2);
}

TEST(Clients, AnswersQuestionsBeforeItMakesFrames) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  page.say({{"type", "probe"}, {"id", 5}, {"x", 0.5}, {"y", 0.5}});
  page.say({{"type", "photo"}, {"split", "test"}, {"index", 0}, {"width", 50}});
  page.say({{"type", "still"}, {"id", 6}, {"width", 20}, {"height", 10}});
  EXPECT_EQ(std::get<ProbeJob>(clients.next()->what).probe.id, 5);
  EXPECT_TRUE(std::get<Photo>(clients.next()->what).photo.test);
  EXPECT_EQ(std::get<StillJob>(clients.next()->what).view_request.id, 1);
  EXPECT_TRUE(std::holds_alternative<FrameJob>(clients.next()->what));
}

TEST(Clients, RefusesAQuestionAboutNothing) {
  Clients clients;
  FakePage page(clients, 1);
  page.say({{"type", "probe"}, {"id", 5}, {"x", 0.5}, {"y", 0.5}});
  EXPECT_FALSE(clients.next());
  EXPECT_EQ(page.of("refused").at(0).json["id"], 5);
}

TEST(Clients, RefusesQuestionsWithoutEnd) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  for (int i = 0; i < 1000; ++i) page.say({{"type", "still"}, {"id", i}, {"width", 8192}, {"height", 8192}});
  EXPECT_GT(page.of("refused").size(), 900U);
  int asked = 0;
  while (std::holds_alternative<StillJob>(clients.next()->what)) ++asked;
  EXPECT_LT(asked, 100);
}

TEST(Clients, TakesPagesInTurns) {
  Clients clients;
  FakePage one(clients, 1), two(clients, 2), three(clients, 3);
  std::vector<uint64_t> served;
  for (int64_t round = 1; round <= 4; ++round) {
    for (FakePage* page : {&one, &two, &three}) page->say(view_request(round, true));
    for (int i = 0; i < 3; ++i) {
      const auto job = clients.next();
      ASSERT_TRUE(job);
      served.push_back(job->client);
      make_frame(clients, *job);
    }
    for (FakePage* page : {&one, &two, &three}) page->acknowledge_frames();
  }
  for (size_t i = 0; i < served.size(); i += 3) {
    EXPECT_THAT(std::vector<uint64_t>(served.begin() + static_cast<std::ptrdiff_t>(i),
                                      served.begin() + static_cast<std::ptrdiff_t>(i) + 3),
                ::testing::UnorderedElementsAre(1, 2, 3));
  }
}

TEST(Clients, ShowsAChangedSceneToWhomeverRests) {
  Clients clients;
  FakePage resting(clients, 1), moving(clients, 2);
  resting.say(view_request(1));
  moving.say(view_request(1, true));
  while (const auto job = clients.next()) {
    make_frame(clients, *job);
    resting.acknowledge_frames();
    moving.acknowledge_frames();
  }
  clients.scene_changed({});
  const auto job = clients.next();
  ASSERT_TRUE(job);
  EXPECT_EQ(job->client, 1U);
  const Coarseness& coarseness = std::get<FrameJob>(job->what).coarseness;
  EXPECT_TRUE(coarseness.final);
  EXPECT_EQ(coarseness.divisor, 1) << "what is shown stays as fine as it was";
  make_frame(clients, *job);
  resting.acknowledge_frames();
  EXPECT_FALSE(clients.next());
  // Not again until its time has come.
  clients.scene_changed(std::chrono::hours(1));
  EXPECT_FALSE(clients.next());
}

TEST(Clients, SaysWhyAMessageCannotBeUnderstood) {
  Clients clients;
  FakePage page(clients, 1);
  json broken = view_request(9);
  broken["time"] = 2;
  page.say(broken);
  page.say_text("nonsense");
  const std::vector<Received> refused = page.of("refused");
  ASSERT_EQ(refused.size(), 2U);
  EXPECT_EQ(refused[0].json["request"], "view");
  EXPECT_EQ(refused[0].json["id"], 9);
  EXPECT_THAT(refused[0].json["text"].get<std::string>(), ::testing::HasSubstr("time"));
  EXPECT_EQ(refused[1].json["request"], "");
  EXPECT_FALSE(clients.next());
}

TEST(Clients, AViewThatCannotBeShownIsNotTriedAgain) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  clients.refuse(*clients.next(), "no such layer");
  EXPECT_EQ(page.of("refused").at(0).json["request"], "view");
  EXPECT_FALSE(clients.next());
}

TEST(Clients, AFrameWithoutMemoryComesCoarserAndNotAtOnce) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  serve_all(clients, page);
  page.say(view_request(2));
  make_frame(clients, *clients.next());
  page.acknowledge_frames();
  const auto job = clients.next();
  ASSERT_TRUE(job);
  clients.no_memory_for(*job);
  EXPECT_TRUE(clients.any_lacks_memory());
  EXPECT_FALSE(clients.next()) << "a retry_after, not a loop";
  page.leave();
  EXPECT_FALSE(clients.any_lacks_memory());
}

TEST(Clients, MakesWhatIsAllowedAndAlwaysAFirstFrame) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  const auto first = clients.next({false, false});
  ASSERT_TRUE(first);
  make_frame(clients, *first);
  page.acknowledge_frames();
  EXPECT_FALSE(clients.next({false, false}));
  EXPECT_FALSE(clients.next({false, true}));
  while (const auto job = clients.next({true, false})) {
    make_frame(clients, *job);
    page.acknowledge_frames();
  }
  clients.scene_changed({});
  EXPECT_FALSE(clients.next({true, false}));
  EXPECT_TRUE(clients.next({false, true}));
}

TEST(Clients, PassesCommandsOnWhereSomethingIsTrained) {
  std::vector<Action> done;
  Clients training([&](Action action) { done.push_back(action); });
  FakePage page(training, 1);
  for (const char* word : {"pause", "resume", "save", "stop"}) page.say({{"type", "command"}, {"do", word}});
  EXPECT_THAT(done, ::testing::ElementsAre(Action::pause, Action::resume, Action::save, Action::stop));

  Clients viewing;
  FakePage other(viewing, 1);
  other.say({{"type", "command"}, {"do", "stop"}});
  EXPECT_EQ(other.of("refused").size(), 1U);
}

TEST(Clients, WhatIsForAPageThatHasLeftGoesNowhere) {
  Clients clients;
  FakePage page(clients, 1);
  page.say(view_request(1));
  const auto job = clients.next();
  page.leave();
  make_frame(clients, *job);
  clients.refuse(*job, "late");
  page.say(view_request(2));
  EXPECT_FALSE(clients.next());
  EXPECT_TRUE(page.of("frame").empty());
}

}  // namespace
}  // namespace traceflow::serve

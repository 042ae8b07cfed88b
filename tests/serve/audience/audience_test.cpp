#include "serve/audience/audience.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "serve/audience/fake_page.h"

namespace traceflow::serve {
namespace {

using nlohmann::json;
using serve::testing::FakePage;
using serve::testing::look;
using serve::testing::Received;

// What a renderer would do with a frame's job.
void make_frame(Audience& audience, const Job& job) {
  const FrameJob& frame = std::get<FrameJob>(job.what);
  const double divisor = frame.coarseness.divisor;
  audience.show_frame(job, {{"type", "frame"}, {"look", frame.look.id}, {"final", frame.coarseness.final}},
                      "picture", 96 * 64 / (divisor * divisor), 1e-4);
}

// Serves a page until nothing is left to do; returns the frames' coarseness.
std::vector<Coarseness> serve_all(Audience& audience, FakePage& page) {
  std::vector<Coarseness> made;
  while (const auto job = audience.next()) {
    made.push_back(std::get<FrameJob>(job->what).coarseness);
    make_frame(audience, *job);
    page.see_frames();
  }
  return made;
}

std::vector<std::string> types(const FakePage& page) {
  std::vector<std::string> list;
  for (const Received& r : page.all()) list.push_back(r.json["type"]);
  return list;
}

TEST(Audience, TellsANewcomerWhatThereIs) {
  Audience audience;
  audience.greet_with(R"({"type":"hello"})");
  audience.tell({R"({"event":"saved","iteration":4})"});
  audience.tell_trouble("disk", "It is full.");
  audience.set_state({false, false, 4, 10, 100, 20});
  const FakePage page(audience, 1);
  EXPECT_THAT(types(page), ::testing::ElementsAre("hello", "events", "trouble", "state"));
  EXPECT_EQ(page.of("events")[0].json,
            json::parse(R"({"type":"events","events":[{"event":"saved","iteration":4}],
      "reset":true})"));
  EXPECT_EQ(page.of("trouble")[0].json["text"], "It is full.");
  EXPECT_EQ(page.of("state")[0].json,
            json::parse(R"({"type":"state","paused":false,"over":false,"iteration":4,
      "iterations":10,"surfels":{"main":100,"environment":20},"viewers":1})"));
}

TEST(Audience, TellsEverybodyWhatChanges) {
  Audience audience;
  const FakePage page(audience, 1);
  FakePage other(audience, 2);
  audience.greet_with("{\"type\":\"hello\"}");
  audience.greet_with("{\"type\":\"hello\"}");
  EXPECT_EQ(page.of("hello").size(), 1U) << "said once, because nothing changed";
  audience.tell({R"({"event":"step","iteration":1})", R"({"event":"step","iteration":2})"});
  EXPECT_EQ(page.of("events").back().json["events"].size(), 2U);
  EXPECT_EQ(other.of("events").back().json["reset"], false);
  other.leave();
  EXPECT_EQ(page.of("state").back().json["viewers"], 1);
  EXPECT_EQ(audience.viewers(), 1);
}

TEST(Audience, TroublesEndOneByOne) {
  Audience audience;
  const FakePage page(audience, 1);
  audience.tell_trouble("memory", "");
  EXPECT_TRUE(page.of("trouble").empty());
  audience.tell_trouble("memory", "No memory.");
  audience.tell_trouble("run", "No run.");
  audience.tell_trouble("run", "No run.");
  EXPECT_EQ(page.of("trouble").back().json["text"], "No memory. No run.");
  audience.tell_trouble("memory", "");
  EXPECT_EQ(page.of("trouble").back().json["text"], "No run.");
  audience.tell_trouble("run", "");
  EXPECT_EQ(page.of("trouble").back().json["text"], "");
  EXPECT_EQ(page.of("trouble").size(), 4U);
}

TEST(Audience, HasNothingToDoWhileNobodyLooks) {
  Audience audience;
  EXPECT_FALSE(audience.next());
  FakePage page(audience, 1);
  EXPECT_FALSE(audience.next());
  EXPECT_FALSE(audience.wait({}));
  page.say(look(1));
  EXPECT_TRUE(audience.wait({}));
  page.say({{"type", "sleep"}});
  EXPECT_FALSE(audience.next());
  page.say(look(2));
  EXPECT_TRUE(audience.next());
  page.leave();
  EXPECT_FALSE(audience.next());
}

TEST(Audience, ShowsARestingLookFinerAndFinerUntilItIsFinal) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1));
  const std::vector<Coarseness> made = serve_all(audience, page);
  ASSERT_GE(made.size(), 2U);
  EXPECT_GT(made.front().divisor, 1);
  EXPECT_EQ(made.back().divisor, 1);
  for (const Coarseness& c : made) EXPECT_EQ(c.final, &c == &made.back());
  EXPECT_EQ(page.of("frame").size(), made.size());
}

TEST(Audience, ShowsAMovingLookOnce) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1, true));
  EXPECT_EQ(serve_all(audience, page).size(), 1U);
}

TEST(Audience, TheNewestLookCounts) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1, true));
  page.say(look(2, true));
  const auto job = audience.next();
  ASSERT_TRUE(job);
  EXPECT_EQ(std::get<FrameJob>(job->what).look.id, 2);
  // Another one comes while this one is rendered: the frame goes out, and the new one is still wanted.
  page.say(look(3, true));
  make_frame(audience, *job);
  const auto next = audience.next();
  ASSERT_TRUE(next);
  EXPECT_EQ(std::get<FrameJob>(next->what).look.id, 3);
}

TEST(Audience, RunsNoMoreThanTwoFramesAhead) {
  Audience audience;
  FakePage page(audience, 1);
  for (int64_t id = 1; id <= 2; ++id) {
    page.say(look(id, true));
    make_frame(audience, *audience.next());
  }
  page.say(look(3, true));
  EXPECT_FALSE(audience.next());
  page.say({{"type", "seen"}, {"frame", 1}});
  EXPECT_TRUE(audience.next());
  EXPECT_EQ(page.of("frame")[0].json["frame"], 1);
  EXPECT_EQ(page.of("frame")[1].json["frame"], 2);
}

TEST(Audience, AnswersQuestionsBeforeItMakesFrames) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1));
  page.say({{"type", "probe"}, {"id", 5}, {"x", 0.5}, {"y", 0.5}});
  page.say({{"type", "photo"}, {"split", "test"}, {"index", 0}, {"width", 50}});
  page.say({{"type", "still"}, {"id", 6}, {"width", 20}, {"height", 10}});
  EXPECT_EQ(std::get<ProbeJob>(audience.next()->what).probe.id, 5);
  EXPECT_TRUE(std::get<Photo>(audience.next()->what).photo.test);
  EXPECT_EQ(std::get<StillJob>(audience.next()->what).look.id, 1);
  EXPECT_TRUE(std::holds_alternative<FrameJob>(audience.next()->what));
}

TEST(Audience, RefusesAQuestionAboutNothing) {
  Audience audience;
  FakePage page(audience, 1);
  page.say({{"type", "probe"}, {"id", 5}, {"x", 0.5}, {"y", 0.5}});
  EXPECT_FALSE(audience.next());
  EXPECT_EQ(page.of("refused").at(0).json["id"], 5);
}

TEST(Audience, RefusesQuestionsWithoutEnd) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1));
  for (int i = 0; i < 1000; ++i) page.say({{"type", "still"}, {"id", i}, {"width", 8192}, {"height", 8192}});
  EXPECT_GT(page.of("refused").size(), 900U);
  int asked = 0;
  while (std::holds_alternative<StillJob>(audience.next()->what)) ++asked;
  EXPECT_LT(asked, 100);
}

TEST(Audience, TakesPagesInTurns) {
  Audience audience;
  FakePage one(audience, 1), two(audience, 2), three(audience, 3);
  std::vector<uint64_t> served;
  for (int64_t round = 1; round <= 4; ++round) {
    for (FakePage* page : {&one, &two, &three}) page->say(look(round, true));
    for (int i = 0; i < 3; ++i) {
      const auto job = audience.next();
      ASSERT_TRUE(job);
      served.push_back(job->guest);
      make_frame(audience, *job);
    }
    for (FakePage* page : {&one, &two, &three}) page->see_frames();
  }
  for (size_t i = 0; i < served.size(); i += 3) {
    EXPECT_THAT(std::vector<uint64_t>(served.begin() + static_cast<std::ptrdiff_t>(i),
                                      served.begin() + static_cast<std::ptrdiff_t>(i) + 3),
                ::testing::UnorderedElementsAre(1, 2, 3));
  }
}

TEST(Audience, ShowsAChangedSceneToWhomeverRests) {
  Audience audience;
  FakePage resting(audience, 1), moving(audience, 2);
  resting.say(look(1));
  moving.say(look(1, true));
  while (const auto job = audience.next()) {
    make_frame(audience, *job);
    resting.see_frames();
    moving.see_frames();
  }
  audience.scene_changed({});
  const auto job = audience.next();
  ASSERT_TRUE(job);
  EXPECT_EQ(job->guest, 1U);
  const Coarseness& coarseness = std::get<FrameJob>(job->what).coarseness;
  EXPECT_TRUE(coarseness.final);
  EXPECT_EQ(coarseness.divisor, 1) << "what is shown stays as fine as it was";
  make_frame(audience, *job);
  resting.see_frames();
  EXPECT_FALSE(audience.next());
  // Not again until its time has come.
  audience.scene_changed(std::chrono::hours(1));
  EXPECT_FALSE(audience.next());
}

TEST(Audience, SaysWhyAMessageCannotBeUnderstood) {
  Audience audience;
  FakePage page(audience, 1);
  json broken = look(9);
  broken["time"] = 2;
  page.say(broken);
  page.say_text("nonsense");
  const std::vector<Received> refused = page.of("refused");
  ASSERT_EQ(refused.size(), 2U);
  EXPECT_EQ(refused[0].json["request"], "look");
  EXPECT_EQ(refused[0].json["id"], 9);
  EXPECT_THAT(refused[0].json["text"].get<std::string>(), ::testing::HasSubstr("time"));
  EXPECT_EQ(refused[1].json["request"], "");
  EXPECT_FALSE(audience.next());
}

TEST(Audience, ALookThatCannotBeShownIsNotTriedAgain) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1));
  audience.refuse(*audience.next(), "no such layer");
  EXPECT_EQ(page.of("refused").at(0).json["request"], "look");
  EXPECT_FALSE(audience.next());
}

TEST(Audience, PassesCommandsOnWhereSomethingIsTrained) {
  std::vector<Do> done;
  Audience training([&](Do what) { done.push_back(what); });
  FakePage page(training, 1);
  for (const char* word : {"pause", "resume", "save", "stop"}) page.say({{"type", "command"}, {"do", word}});
  EXPECT_THAT(done, ::testing::ElementsAre(Do::pause, Do::resume, Do::save, Do::stop));

  Audience viewing;
  FakePage other(viewing, 1);
  other.say({{"type", "command"}, {"do", "stop"}});
  EXPECT_EQ(other.of("refused").size(), 1U);
}

TEST(Audience, WhatIsForAPageThatHasLeftGoesNowhere) {
  Audience audience;
  FakePage page(audience, 1);
  page.say(look(1));
  const auto job = audience.next();
  page.leave();
  make_frame(audience, *job);
  audience.refuse(*job, "late");
  page.say(look(2));
  EXPECT_FALSE(audience.next());
  EXPECT_TRUE(page.of("frame").empty());
}

}  // namespace
}  // namespace traceflow::serve

#include "record/log_history.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <streambuf>

#include "record/event_log.h"
#include "record/log_lines.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using testing::log_line;
using testing::start_line;

std::string step_line(int64_t iteration, const std::string& phase = "diffuse") {
  events::Step step;
  step.iteration = iteration;
  step.phase = phase;
  step.seconds = 0.5 * static_cast<double>(iteration);
  return log_line(step);
}

std::vector<LoggedEvent> read(const std::string& text) {
  std::istringstream in(text);
  return read_log(in);
}

// "started 0, step 1, …".
std::string told(const std::vector<LoggedEvent>& events) {
  std::string text;
  for (const LoggedEvent& e : events)
    text += (text.empty() ? "" : ", ") + e.kind + " " + std::to_string(e.iteration);
  return text;
}

TEST(LogHistory, AResumedRunGoesBackToItsCheckpoint) {
  const std::string first = start_line(0) + log_line(events::PhaseEntered{0, "diffuse"}) + step_line(1) +
                            step_line(2) + log_line(events::Measured{2, "diffuse", 2, {}}) +
                            log_line(events::Saved{2, "c", 1}) + log_line(events::PhaseEntered{2, "joint"}) +
                            step_line(3, "joint") +
                            log_line(events::Finished{events::Ending::diverged, 2, 1, 2, {}, "why"});
  const std::string second = start_line(2) + log_line(events::PhaseEntered{2, "joint"}) +
                             step_line(3, "joint") + step_line(4, "joint") + log_line(events::Finished{});
  EXPECT_EQ(told(read(first + second)),
            "started 0, phase_entered 0, step 1, step 2, measured 2, saved 2, started 2, phase_entered 2, "
            "step 3, step 4, finished 0");
}

// An iteration that fails after its parting is begun again, and parts them again.
TEST(LogHistory, WhatAnIterationBeganWithIsToldOnce) {
  const std::string began = log_line(events::FollowingDecided{2, true, 0.5}) +
                            log_line(events::BodiesParted{2, 1, 3}) + log_line(events::PriorsTurned{2, 4}) +
                            log_line(events::BendingDecided{2, 0, true, 1.5, std::nullopt});
  EXPECT_EQ(told(read(start_line(0) + step_line(2) + began + start_line(2) + began + step_line(3))),
            "started 0, step 2, started 2, following_decided 2, bodies_parted 2, priors_turned 2, "
            "bending_decided 2, step 3");
}

TEST(LogHistory, ARunBegunAnewDropsWhatCameBefore) {
  EXPECT_EQ(told(read(start_line(0) + log_line(events::Warning{0, "w"}) + step_line(1) + start_line(0) +
                      log_line(events::Warning{0, "w"}) + step_line(1))),
            "started 0, warning 0, step 1");
}

TEST(LogHistory, WarningsOfEverySessionAreToldOnce) {
  EXPECT_EQ(told(read(start_line(0) + log_line(events::Warning{0, "a"}) + step_line(5) + start_line(5) +
                      log_line(events::Warning{5, "a"}) + log_line(events::Warning{5, "b"}))),
            "started 0, warning 0, step 5, started 5, warning 5");
}

TEST(LogHistory, ALostStartIsSeenByTheSteps) {
  EXPECT_EQ(told(read(step_line(1) + step_line(2) + step_line(3) + "{\"event\":\"star" + "\n" + step_line(2) +
                      step_line(3))),
            "step 1, step 2, step 3");
}

TEST(LogHistory, DamagedLinesAreLeftOut) {
  const std::string bad[] = {"",
                             "null",
                             "[]",
                             "7",
                             "{}",
                             "\xff\xfe",
                             R"({"event":"step"})",
                             R"({"event":5,"iteration":1})",
                             R"({"event":"step","iteration":-4})",
                             R"({"event":"step","iteration":1e300})",
                             R"({"event":"step","iteration":"3"})",
                             R"({"event":"","iteration":3})",
                             std::string(300'000, '['),
                             R"({"event":"x","iteration":)" + std::string(100'000, '['),
                             std::string("\0\0\0", 3)};
  for (const std::string& text : bad)
    EXPECT_EQ(told(read(step_line(1) + text + "\n" + step_line(2))), "step 1, step 2") << text.substr(0, 40);
  // Deep inside of an event: the event stays, without it.
  const std::string deep =
      R"({"event":"x","iteration":3,"a":)" + std::string(2000, '[') + std::string(2000, ']') + "}";
  const auto events = read(deep);
  EXPECT_EQ(told(events), "x 3");
  for (const LoggedEvent& e : events) EXPECT_LT(e.line.size(), 200U);
  // More than an event holds.
  std::string full = R"({"event":"x","iteration":3,"a":[0)";
  for (int i = 0; i < 5000; ++i) full += ",0";
  EXPECT_EQ(told(read(full + "]}")), "");
}

// Wherever a log is cut, what is read is a beginning of the whole.
RC_GTEST_PROP(LogHistory, a_half_written_end_loses_no_other_line, ()) {
  std::string text = start_line(0);
  for (int i = 1; i < 6; ++i) text += step_line(i);
  const auto whole = read(text);
  const auto cut = static_cast<size_t>(*rc::gen::inRange(0, static_cast<int>(text.size())));
  const auto part = read(text.substr(0, cut));
  const auto lines =
      static_cast<size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(cut), '\n'));
  RC_ASSERT(part.size() >= lines && part.size() <= lines + 1);
  for (size_t i = 0; i < part.size(); ++i) RC_ASSERT(part[i].line == whole[i].line);
}

// Sessions that overlap read as one that was never stopped.
RC_GTEST_PROP(LogHistory, sessions_read_as_one, ()) {
  std::string text = start_line(0);
  int64_t at = 0;
  for (int session = *rc::gen::inRange(0, 5); session > 0; --session) {
    const int64_t stop = at + *rc::gen::inRange(0, 30);
    for (int64_t i = at + 1; i <= stop; ++i) text += step_line(i);
    at = *rc::gen::inRange<int64_t>(at, stop + 1);
    text += start_line(at);
  }
  for (int64_t i = at + 1; i <= 150; ++i) text += step_line(i);
  int64_t next = 1;
  for (const LoggedEvent& e : read(text)) {
    if (e.kind == "step") RC_ASSERT(e.iteration == next++);
  }
  RC_ASSERT(next == 151);
}

RC_GTEST_PROP(LogHistory, thinning_keeps_first_last_and_all_that_is_no_step, ()) {
  const int count = *rc::gen::inRange(0, 400);
  std::vector<LoggedEvent> events;
  events.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i)
    events.push_back({*rc::gen::inRange(0, 3) == 0 ? "saved" : "step", i, std::to_string(i)});
  const auto wanted = static_cast<size_t>(*rc::gen::inRange(2, 60));
  const auto kept = thinned(events, wanted);
  const auto only = [](const std::vector<LoggedEvent>& all, bool steps) {
    std::vector<int64_t> list;
    for (const LoggedEvent& e : all) {
      if ((e.kind == "step") == steps) list.push_back(e.iteration);
    }
    return list;
  };
  const auto before = only(events, true), after = only(kept, true);
  RC_ASSERT(only(kept, false) == only(events, false));
  RC_ASSERT(after.size() == std::min(before.size(), wanted));
  RC_ASSERT(std::is_sorted(kept.begin(), kept.end(),
                           [](const auto& a, const auto& b) { return a.iteration < b.iteration; }));
  if (!before.empty()) RC_ASSERT(after.front() == before.front() && after.back() == before.back());
}

TEST(LogHistory, PhasesAddUpTimeAndSteps) {
  const std::string text =
      start_line(0) + log_line(events::PhaseEntered{0, "diffuse"}) + step_line(10) + step_line(20) +
      log_line(events::Measured{25, "diffuse", 25, {{"raster", 50, 4}, {"loss", 25, 5}}}) +
      log_line(events::PhaseEntered{25, "joint"}) + step_line(30, "joint") +
      log_line(events::Measured{30, "joint", 5, {{"trace", 5, 1}}}) + step_line(40, "joint") +
      log_line(events::Measured{40, "joint", 1, {{"trace", 1, 0.25}, {"raster", 2, 4}}});
  const auto phases = phases_of(read(text));
  ASSERT_EQ(phases.size(), 2U);
  EXPECT_EQ(phases[0].name, "diffuse");
  EXPECT_EQ(phases[0].first, 1);
  EXPECT_EQ(phases[0].last, 25);
  EXPECT_DOUBLE_EQ(phases[0].seconds, 10);
  ASSERT_EQ(phases[0].steps.size(), 2U);
  EXPECT_EQ(phases[0].steps[0].name, "loss");
  EXPECT_EQ(phases[0].steps[1].calls, 50);
  EXPECT_EQ(phases[1].first, 26);
  EXPECT_EQ(phases[1].last, 40);
  EXPECT_DOUBLE_EQ(phases[1].seconds, 10);
  // One of ten iterations was measured: scaled up.
  ASSERT_EQ(phases[1].steps.size(), 2U);
  EXPECT_EQ(phases[1].steps[0].name, "raster");
  EXPECT_DOUBLE_EQ(phases[1].steps[0].seconds, 40);
  EXPECT_EQ(phases[1].steps[1].calls, 15);
  EXPECT_DOUBLE_EQ(phases[1].steps[1].seconds, 3.5);
}

TEST(LogHistory, PhasesOfOddEventsAreNoError) {
  for (
      const char* text :
      {R"({"event":"measured","iteration":5,"iterations":0,"steps":[]})",
       R"({"event":"measured","iteration":5,"phase":"a","iterations":5,"steps":[3,{"name":"x","calls":1e200}]})",
       R"({"event":"step","iteration":5,"phase":7,"seconds":null})",
       R"({"event":"phase_entered","iteration":5})"}) {
    EXPECT_LE(phases_of(read(text)).size(), 1U) << text;
  }
}

// Sums over them would be beyond any number.
TEST(LogHistory, CountsThatNoRunReachesAreNone) {
  EXPECT_FALSE(read_event(R"({"event":"step","iteration":9223372036854775807})"));
  EXPECT_TRUE(read_event(R"({"event":"step","iteration":9007199254740992})"));
  const std::vector<LoggedPhase> phases = phases_of(
      read(R"({"event":"measured","iteration":9000000000000000,"phase":"a","iterations":9000000000000000,)"
           R"("steps":[{"name":"many","calls":1e14},{"name":"few","calls":2}]})"));
  ASSERT_EQ(phases.size(), 1U);
  ASSERT_EQ(phases[0].steps.size(), 1U);
  EXPECT_EQ(phases[0].steps[0].name, "few");
}

// A text, as often as wanted, of which nothing is kept.
class Repeated : public std::streambuf {
 public:
  Repeated(std::string text, int64_t times) : text_(std::move(text)), left_(times) {}
  int64_t taken() const { return taken_; }

 protected:
  int_type underflow() override {
    if (left_-- <= 0) return traits_type::eof();
    taken_ += static_cast<int64_t>(text_.size());
    setg(text_.data(), text_.data(), text_.data() + text_.size());
    return traits_type::to_int_type(text_[0]);
  }

 private:
  std::string text_;
  int64_t left_, taken_ = 0;
};

TEST(LogHistory, ALineThatIsTooLongIsPassedOver) {
  for (const int64_t length : {int64_t{1} << 20, (int64_t{1} << 20) + 1, int64_t{3} << 20}) {
    const std::string line(static_cast<size_t>(length), ' ');
    EXPECT_EQ(told(read(step_line(1) + line + "\n" + step_line(2))), "step 1, step 2") << length;
  }
}

// A run's folder may come from anywhere.
TEST(LogHistory, ALogWithoutEndIsReadToALimit) {
  constexpr int64_t limit = int64_t{256} << 20;
  Repeated zeros(std::string(size_t{1} << 20, '\0'), 100'000);
  std::istream endless(&zeros);
  EXPECT_TRUE(read_log(endless).empty());
  EXPECT_LE(zeros.taken(), 2 * limit);

  Repeated events(std::string(1000, ' ') + R"({"event":"x","iteration":1})" + "\n", 1'000'000);
  std::istream many(&events);
  EXPECT_EQ(read_log(many).size(), 200'000U);
}

TEST(LogHistory, AFileThatIsNotThereHoldsNothing) {
  const TempFolder folder;
  EXPECT_TRUE(read_log(folder / "log.jsonl").empty());
  std::ofstream(folder / "log.jsonl") << step_line(3);
  EXPECT_EQ(told(read_log(folder / "log.jsonl")), "step 3");
}

// Nobody writes to the pipe: whoever opens it waits.
TEST(LogHistory, WhatIsNoFileHoldsNothing) {
  const TempFolder folder;
  ASSERT_EQ(::mkfifo((folder / "log.jsonl").c_str(), 0600), 0);
  EXPECT_TRUE(read_log(folder / "log.jsonl").empty());
  EXPECT_TRUE(read_log(folder.path()).empty());
}

}  // namespace
}  // namespace traceflow

#include "serve/clients/history.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace traceflow::serve {
namespace {

using nlohmann::json;

std::string step(int64_t iteration) {
  return R"({"event":"step","iteration":)" + std::to_string(iteration) + "}";
}

TEST(History, KeepsAShortRunWhole) {
  History history;
  std::vector<std::string> told;
  for (int64_t i = 1; i <= 100; ++i) told.push_back(step(i));
  told.emplace_back(R"({"event":"saved","iteration":100})");
  for (const std::string& line : told) history.add(line);
  EXPECT_EQ(history.lines(), told);
}

// Steps are thinned evenly over the whole run; everything else stays, in its place.
TEST(History, ThinsTheStepsOfALongRunAndNothingElse) {
  History history;
  for (int64_t i = 1; i <= 60'000; ++i) {
    history.add(step(i));
    if (i % 1000 == 0) history.add(R"({"event":"saved","iteration":)" + std::to_string(i) + "}");
  }
  int64_t steps = 0, others = 0, last = 0;
  for (const std::string& line : history.lines()) {
    const json event = json::parse(line);
    const auto iteration = event["iteration"].get<int64_t>();
    EXPECT_GE(iteration, last);
    if (event["event"] == "step") {
      EXPECT_LE(iteration - last, 32);
      ++steps;
    } else {
      ++others;
    }
    last = iteration;
  }
  EXPECT_EQ(others, 60);
  EXPECT_GT(steps, 1900);
  EXPECT_LE(steps, 4000);
}

TEST(History, PassesByWhatIsNoEvent) {
  History history;
  for (const char* line :
       {"", "x", "{}", "[1]", R"({"event":"step"})", R"({"event":"step","iteration":"1"})"})
    history.add(line);
  EXPECT_TRUE(history.lines().empty());
}

TEST(History, TellsAMessageOfItsLines) {
  EXPECT_EQ(json::parse(events_text({step(1), step(2)}, true)),
            json::parse(
                R"({"type":"events","events":[{"event":"step","iteration":1},{"event":"step","iteration":2}],
                "reset":true})"));
  EXPECT_EQ(json::parse(events_text({}, false)),
            json::parse(R"({"type":"events","events":[],"reset":false})"));
}

}  // namespace
}  // namespace traceflow::serve
